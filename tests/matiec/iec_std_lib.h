/*
 * Stub for the file of this name in matiec's runtime library: the parts that this test's program uses. Its macros
 * have the names of the library.
 */
#ifndef IEC_STD_LIB_H
#define IEC_STD_LIB_H
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "iec_types.h"

typedef uint8_t BOOL;
typedef uint8_t BYTE;
typedef uint8_t USINT;
typedef uint16_t WORD;
typedef uint16_t UINT;
typedef int16_t INT;
typedef int32_t DINT;
typedef uint32_t DWORD;
typedef IEC_TIMESPEC TIME;
#define __IEC_FORCE_FLAG 0x02
#define __IEC_RETAIN_FLAG 0x04

#define __DECLARE_COMPLEX_STRUCT(type)                                                                           \
    typedef struct { type *value; IEC_BYTE flags; type fvalue; } __IEC_##type##_p;                               \
    typedef struct { type value; IEC_BYTE flags; } __IEC_##type##_t;
#define __DECLARE_ARRAY_TYPE(type, base, size)                                                                   \
    typedef struct { base table size; } type;                                                                    \
    __DECLARE_COMPLEX_STRUCT(type)
#define __DECLARE_STRUCT_TYPE(type, elements)                                                                    \
    typedef struct { elements } type;                                                                            \
    __DECLARE_COMPLEX_STRUCT(type)

__DECLARE_COMPLEX_STRUCT(BOOL)
__DECLARE_COMPLEX_STRUCT(BYTE)
__DECLARE_COMPLEX_STRUCT(WORD)
__DECLARE_COMPLEX_STRUCT(UINT)
__DECLARE_COMPLEX_STRUCT(INT)
__DECLARE_COMPLEX_STRUCT(DINT)

extern TIME __CURRENT_TIME;
extern BOOL __DEBUG;

#include "accessor.h"

#endif
