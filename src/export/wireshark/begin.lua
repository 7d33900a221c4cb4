-- The decoders by kinds of buses. A decoder gets a frame or telegram and a function that shows a value; it returns the
-- text of `commram trace`, and true if the name of a message says more.
local decoders = {}

-- `count` bits of a number from bit `first` on.
local function bits(value, first, count)
    return math.floor(value / 2 ^ first) % 2 ^ count
end

-- A number of `count` bytes from byte `first` on, counted from 1, the lowest one first. Missing bytes are 0.
local function little(data, first, count)
    local value = 0
    for at = first + count - 1, first, -1 do
        value = value * 256 + (data[at] or 0)
    end
    return value
end

-- The text of a value in a list of ranges and texts.
local function meaning(ranges, value)
    for _, range in ipairs(ranges) do
        if range[1] <= value and value <= range[2] then return range[3] end
    end
end

-- Bytes in hexadecimal, each after a blank.
local function bytes(data, first, last)
    local text = ""
    for at = first, math.min(last, #data) do
        text = text .. string.format(" %02X", data[at])
    end
    return text
end

