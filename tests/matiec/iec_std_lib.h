/* Stand-in for the file of this name in matiec's runtime library: the types that this test's program uses. */
#ifndef IEC_STD_LIB_H
#define IEC_STD_LIB_H
#include <stdint.h>

typedef uint8_t IEC_BYTE;
typedef uint8_t BOOL;
typedef uint8_t BYTE;
typedef uint16_t WORD;
typedef uint16_t UINT;
typedef int32_t DINT;
typedef struct { BYTE *value; IEC_BYTE flags; BYTE fvalue; } __IEC_BYTE_p;
typedef struct { WORD *value; IEC_BYTE flags; WORD fvalue; } __IEC_WORD_p;
typedef struct { DINT *value; IEC_BYTE flags; DINT fvalue; } __IEC_DINT_p;
typedef struct { BOOL *value; IEC_BYTE flags; BOOL fvalue; } __IEC_BOOL_p;
typedef struct { UINT *value; IEC_BYTE flags; UINT fvalue; } __IEC_UINT_p;

#endif
