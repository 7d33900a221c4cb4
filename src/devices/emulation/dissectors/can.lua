-- CAN: identifier and data.
decoders["can"] = function(frame)
    local id = string.format(frame.is_extended and "16#%08X" or "16#%03X", frame.id)
    if frame.is_remote then return string.format("%s remote, length %d", id, frame.length), true end
    return id .. bytes(frame.data, 1, 8), true
end
