/*
 * matiec's own pointers are not volatile: of two writes to a register in one scan an optimizing compiler drops the
 * first, and it may read a register once for many uses. Here they are.
 */
#include "accessor.h"
#undef __DECLARE_LOCATED
#undef __DECLARE_EXTERNAL
#define COMMRAM_POINTER(type, name)                                                                              \
    struct {                                                                                                     \
        volatile type *value;                                                                                    \
        IEC_BYTE flags;                                                                                          \
        type fvalue;                                                                                             \
    } name;
#define __DECLARE_LOCATED(type, name) COMMRAM_POINTER(type, name)
#define __DECLARE_EXTERNAL(type, name) COMMRAM_POINTER(type, name)
