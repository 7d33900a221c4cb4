-- PROFIBUS-DP: addresses, function codes and services of a telegram.
do
    -- Place of the destination's octet after the start delimiter, and of the octets at the end.
    local starts = { [0x10] = 2, [0x68] = 5, [0xA2] = 2 }

    decoders["profibus"] = function(frame, show)
        local data = frame.data
        if data[1] == 0xE5 then return "receipt" end
        if data[1] == 0xDC and #data >= 3 then
            return string.format("token from %d to %d", data[3], data[2])
        end
        local at = starts[data[1]]
        if not at or #data < at + 2 then return "no telegram:" .. bytes(data, 1, 8) end
        local there, here, code = data[at], data[at + 1], data[at + 2]
        local first = at + 3
        -- Check sum and end delimiter follow the data, of which the capture may contain a part.
        local count = frame.length - first - 1
        local function sap(address)
            if address < 0x80 or count < 1 then return nil end
            first, count = first + 1, count - 1
            return data[first - 1]
        end
        local dsap, ssap = sap(there), sap(here)
        local function station(address, point)
            address = address % 0x80
            return point and string.format("%d/%d", address, point) or string.format("%d", address)
        end
        show("source", station(here, ssap))
        show("destination", station(there, dsap))
        show("function", meaning(CODES, code) or "unknown")
        local service = code < 0x80 and meaning(SERVICES, (code >= 0x40 and dsap or ssap) or -1)
        if service then show("service", service) end
        local more = #data < frame.length and " .." or ""
        return string.format(
            "%s to %s, 16#%02X, %d octets%s%s",
            station(here, ssap), station(there, dsap), code, count, bytes(data, first, first + count - 1), more
        )
    end
end
