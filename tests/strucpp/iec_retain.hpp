// Stub of STruC++'s header of this name: variables of a program that are declared RETAIN.
#pragma once
#include <cstddef>
namespace strucpp {
struct RetainVarInfo {
    const char *name;
    size_t offset;
    size_t size;
};
} // namespace strucpp
