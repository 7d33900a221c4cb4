/* Stub for the file of this name in matiec's runtime library. */
#ifndef IEC_TYPES_H
#define IEC_TYPES_H
#include <stdint.h>

typedef uint8_t IEC_BOOL;
typedef uint8_t IEC_BYTE;
typedef struct {
    int32_t tv_sec;
    int32_t tv_nsec;
} IEC_TIMESPEC;
typedef IEC_TIMESPEC IEC_TIME;

#endif
