// Stub of STruC++'s header of this name: located variables. The numbers of an address are as small as in the original.
#pragma once
#include <cstdint>
namespace strucpp {
enum class LocatedArea : uint8_t { Input, Output, Memory };
enum class LocatedSize : uint8_t { Bit, Byte, Word, DWord, LWord };
struct LocatedVar {
    LocatedArea area;
    LocatedSize size;
    uint16_t byte_index;
    uint8_t bit_index;
    uint8_t reserved[3];
    void *pointer;
};
constexpr char area_to_char(LocatedArea area) { return "IQM"[static_cast<unsigned>(area)]; }
} // namespace strucpp
