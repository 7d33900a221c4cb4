// Stub of STruC++'s header of this name: an elementary variable that a debugger can force.
#pragma once
#include <cstdint>
#include <type_traits>
namespace strucpp {
template <typename T> class IECVar {
    T value_{};
    bool forced_ = false;

  public:
    IECVar() = default;
    IECVar(T initial) : value_(initial) {}
    T get() const { return value_; }
    void set(T value) { value_ = value; }
    bool is_forced() const { return forced_; }
    T *raw_ptr() { return &value_; }
    operator T() const { return value_; }
};
using IEC_BOOL = IECVar<bool>;
using IEC_BYTE = IECVar<uint8_t>;
using IEC_WORD = IECVar<uint16_t>;
using IEC_INT = IECVar<int16_t>;
} // namespace strucpp
