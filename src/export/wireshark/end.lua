local protocol = Proto("commram", "commram")
local fields = {
    text = ProtoField.string("commram.text", "Text"),
    bus = ProtoField.string("commram.bus", "Bus"),
    message = ProtoField.string("commram.message", "Message"),
    about = ProtoField.string("commram.about", "Meaning"),
    signal = ProtoField.string("commram.signal", "Signal"),
    name = ProtoField.string("commram.signal.name", "Name"),
    value = ProtoField.uint64("commram.signal.value", "Value", base.DEC_HEX),
}
protocol.fields = fields
for _, bus in ipairs(buses) do
    protocol.prefs[bus.key] = Pref.string("Interface of bus " .. bus.name, bus.name, "Name of the interface in the capture")
end

local interface_name = Field.new("frame.interface_name")

-- The octets of a buffer that were captured.
local function octets(buffer, first, count)
    local data = {}
    for at = first, math.min(first + count, buffer:len()) - 1 do
        data[#data + 1] = buffer(at, 1):uint()
    end
    return data
end

-- A frame in the form of SocketCAN, or the octets of a telegram.
local function packet(buffer, is_can)
    if not is_can then
        return { data = octets(buffer, 0, buffer:len()), length = buffer:reported_len() }
    end
    if buffer:len() < 8 then return nil end
    local head = buffer(0, 4):uint()
    if bits(head, 29, 1) == 1 then return nil end
    local is_extended = bits(head, 31, 1) == 1
    return {
        id = bits(head, 0, is_extended and 29 or 11),
        is_extended = is_extended,
        is_remote = bits(head, 30, 1) == 1,
        length = buffer(4, 1):uint(),
        data = octets(buffer, 8, bits(head, 30, 1) == 1 and 0 or buffer(4, 1):uint()),
    }
end

-- A signal of a message; nil if the frame does not contain it.
local function signal_value(frame, signal)
    if signal.high then
        -- The highest bit comes first, within a byte too.
        local value, byte, bit = 0, math.floor(signal.first / 8) + 1, signal.first % 8
        for _ = 1, signal.bits do
            if not frame.data[byte] then return nil end
            value = value * 2 + bits(frame.data[byte], bit, 1)
            bit = bit - 1
            if bit < 0 then byte, bit = byte + 1, 7 end
        end
        return value
    end
    local first = math.floor(signal.first / 8) + 1
    local last = math.floor((signal.first + signal.bits - 1) / 8) + 1
    if last > #frame.data then return nil end
    return bits(little(frame.data, first, last - first + 1), signal.first % 8, signal.bits)
end

local function show_signals(tree, frame, message)
    local selected
    for _, signal in ipairs(message.signals) do
        if signal.selects then selected = signal_value(frame, signal) end
    end
    for _, signal in ipairs(message.signals) do
        local value = signal_value(frame, signal)
        if value and (signal.only == nil or signal.only == selected) then
            local about = signal.about ~= "" and " (" .. signal.about .. ")" or ""
            local item = tree:add(fields.signal, string.format("%s = %.0f%s", signal.name, value, about))
            item:add(fields.name, signal.name)
            item:add(fields.value, UInt64(bits(value, 0, 32), bits(value, 32, 32)))
        end
    end
end

local function bus_of_packet()
    local interface = interface_name()
    for _, bus in ipairs(buses) do
        if interface and protocol.prefs[bus.key] == interface.value then return bus end
    end
end

function protocol.dissector(buffer, pinfo, root)
    local bus = bus_of_packet()
    local frame = bus and packet(buffer, bus.is_can)
    if not frame then return end
    local tree = root:add(protocol, buffer())
    local shown = {}
    local text, is_raw = decoders[bus.kind](frame, function(name, value)
        shown[#shown + 1] = { name = name, value = value }
    end)
    tree:add(fields.text, text)
    tree:add(fields.bus, bus.name)
    local info = text
    local message = frame.id and bus.messages[(frame.is_extended and "x" or "") .. string.format("%d", frame.id)]
    if message then
        tree:add(fields.message, message.name)
        if message.about ~= "" then tree:add(fields.about, message.about) end
        show_signals(tree, frame, message)
        if is_raw then info = message.name .. ": " .. text end
    end
    for _, item in ipairs(shown) do
        tree:add(fields.signal, item.name .. " = " .. item.value):add(fields.name, item.name)
    end
    tree:append_text(": " .. text)
    pinfo.cols.protocol:set(bus.kind)
    pinfo.cols.info:set(info)
end

register_postdissector(protocol)
