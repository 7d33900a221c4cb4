/* Nor are references to structures (REF_TO), by which function blocks in Structured Text reach registers. */
#include "iec_std_lib.h"
#undef __DECLARE_REFTO_TYPE
#define __DECLARE_REFTO_TYPE(type, name)                                                                         \
    typedef volatile name type;                                                                                  \
    __DECLARE_COMPLEX_STRUCT(type)
