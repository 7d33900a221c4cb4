/*
 * matiec's references to structures (REF_TO) are not volatile, either. Function blocks in Structured Text access
 * registers through such references.
 */
#include "iec_std_lib.h"
#undef __DECLARE_REFTO_TYPE
#define __DECLARE_REFTO_TYPE(type, name)                                                                         \
    typedef volatile name type;                                                                                  \
    __DECLARE_COMPLEX_STRUCT(type)
