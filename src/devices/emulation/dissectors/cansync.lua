-- CANsync: the meaning of identifiers and jobs (manual 5.00005.03a p. 136-143).
do
    local function error_text(errors, number)
        return meaning(errors, number) or "error of the application"
    end

    local function sub_slave(address)
        return address ~= 0 and string.format(", sub-slave 16#%04X", address) or ""
    end

    local function wrong(frame, found, right)
        return nil, string.format("%s with %d data bytes, %s would be right", frame, found, right)
    end

    -- The words of process data; a single last byte is alone.
    local function words(data)
        if #data == 0 then return "no data" end
        local all = {}
        for at = 1, #data, 2 do
            all[#all + 1] = data[at + 1] and string.format("%02X%02X", data[at + 1], data[at]) or string.format("%02X", data[at])
        end
        return table.concat(all, " ")
    end

    local function action(data)
        if #data < 5 then return wrong("action command", #data, "5 to 8") end
        local group, slaves = little(data, 1, 4), {}
        for slave = 0, 31 do
            if bits(group, slave, 1) == 1 then slaves[#slaves + 1] = string.format("%d", slave) end
        end
        local to = "slave " .. table.concat(slaves, ", ")
        if #slaves == 32 then to = "all slaves" elseif #slaves == 0 then to = "no slave" end
        local command, byte, word = data[5], data[6] or 0, little(data, 7, 2)
        local text
        if command == CONTROL_WORD then
            text = string.format("control word 16#%04X", word)
        elseif command == SYNC_MODE then
            text = byte == 1 and "SYNC mode on" or "SYNC mode off"
        else
            text = string.format("command 16#%02X, DB 16#%02X, DW 16#%04X", command, byte, word)
        end
        return "CC to " .. to .. ": " .. text
    end

    local function parameter_job(data)
        local number = little({ data[2], bits(data[1] or 0, 0, 4) }, 1, 2)
        local element, text, sub = bits(data[1] or 0, 4, 4)
        if #data == 4 then
            text, sub = string.format("read parameter %d", number), little(data, 3, 2)
        elseif #data == 6 then
            text, sub = string.format("write parameter %d := 16#%04X", number, little(data, 3, 2)), little(data, 5, 2)
        elseif #data == 8 then
            text, sub = string.format("write parameter %d := 16#%08X", number, little(data, 3, 4)), little(data, 7, 2)
        else
            return wrong("parameter job", #data, "4, 6 or 8")
        end
        if element ~= VALUE_ELEMENT then text = text .. string.format(", element %d", element) end
        return text .. sub_slave(sub)
    end

    local function parameter_answer(data)
        local status, length = data[1] or 0, #data
        local busy, is_error = bits(status, 6, 1) == 1, bits(status, 5, 1) == 1
        local number = little({ data[2] or 0, bits(status, 0, 4) }, 1, 2)
        local word, text, sub = little(data, 3, 2)
        if busy and length >= 2 then
            text, sub = ": BUSY", length == 4 and word or 0
        elseif busy then
            return wrong("BUSY answer", length, "4")
        elseif is_error and length == 6 then
            text = string.format(": error 16#%04X (%s)", word, error_text(PARAMETER_ERRORS, word))
            sub = little(data, 5, 2)
        elseif is_error then
            return wrong("parameter error answer", length, "6")
        elseif length == 4 then
            text, sub = " written", word
        elseif length == 6 then
            text, sub = string.format(" = 16#%04X", word), little(data, 5, 2)
        elseif length == 8 then
            text, sub = string.format(" = 16#%08X", little(data, 3, 4)), little(data, 7, 2)
        else
            return wrong("parameter answer", length, "4, 6 or 8")
        end
        return string.format("parameter %d%s%s", number, text, sub_slave(sub))
    end

    local function up_down_job(data)
        local control, length = data[1], #data
        local is_download, mode = bits(control, 6, 1) == 1, bits(control, 4, 2)
        local offset = little({ data[2] or 0, bits(control, 0, 4) }, 1, 2)
        local direction = is_download and "download" or "upload"
        if mode == 0 then
            return nil, "up-/download job with MODE 00, which is reserved (01 init, 10 body, 11 last block)"
        end
        if mode == 1 then
            if length ~= 8 then return wrong("up-/download init job", length, "8") end
            local address = little(data, 3, 4)
            if address == 0 and offset == 0 then return "cancel up-/download" end
            local text = string.format("%s of %d bytes from 16#%08X begins", direction, offset, address)
            return text .. sub_slave(little(data, 7, 2))
        end
        local right = is_download and 8 or 2
        if length ~= right then return wrong(direction .. " job", length, string.format("%d", right)) end
        local text = string.format("%s, %sblock %d", direction, mode == 3 and "last " or "", offset)
        return is_download and text .. ":" .. bytes(data, 3, 8) or text
    end

    local function up_down_answer(data)
        local status, length = data[1], #data
        local busy, is_error = bits(status, 6, 1) == 1, bits(status, 5, 1) == 1
        local offset = little({ data[2] or 0, bits(status, 0, 4) }, 1, 2)
        local text
        if busy and length >= 2 then
            text = "BUSY"
        elseif busy then
            return wrong("BUSY answer", length, "2")
        elseif is_error and length == 4 then
            local number = little(data, 3, 2)
            text = string.format("error 16#%04X (%s)", number, error_text(UP_DOWNLOAD_ERRORS, number))
        elseif is_error then
            return wrong("up-/download error answer", length, "4")
        elseif length == 2 then
            text = "done"
        elseif length == 8 then
            text = bytes(data, 3, 8):sub(2)
        else
            return wrong("up-/download answer", length, "2 or 8")
        end
        return string.format("up-/download, block %d: %s", offset, text)
    end

    -- Decoder of each group of 128 identifiers, by the upper four bits.
    local groups = {
        [0x2] = function(data, slave) return string.format("WRC1 -> answer by slave %d: %s", slave, words(data)) end,
        [0x3] = function(data, slave) return string.format("WRC2 -> answer by slave %d: %s", slave, words(data)) end,
        [0x6] = function(data, slave) return string.format("RDC1 of slave %d: %s", slave, words(data)) end,
        [0x7] = function(data, slave) return string.format("RDC2 of slave %d: %s", slave, words(data)) end,
        [0xA] = function(data, slave)
            local text, why = (bits(data[1] or 0, 7, 1) == 1 and up_down_job or parameter_job)(data)
            return text and string.format("CC to slave %d: %s", slave, text), why
        end,
        [0xB] = function(data, slave)
            local text, why = (bits(data[1] or 0, 7, 1) == 1 and up_down_answer or parameter_answer)(data)
            return text and string.format("RC of slave %d: %s", slave, text), why
        end,
    }

    decoders["cansync"] = function(frame)
        local id, text, why = string.format("16#%03X", frame.id)
        local group = groups[bits(frame.id, 7, 4)]
        if frame.id == ACTION then
            text, why = action(frame.data)
        elseif group then
            text, why = group(frame.data, bits(frame.id, 0, 7))
        else
            why = string.format("identifier %s is none of CANsync (16#010, 16#100-1FF, 16#300-3FF, 16#500-5FF)", id)
        end
        return text and id .. " " .. text or id .. bytes(frame.data, 1, 8) .. ": " .. why
    end
end
