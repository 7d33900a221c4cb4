/* In the form that OpenPLC's glue generator gives to it: a variable of its own for each located one. */
#include "iec_std_lib.h"

TIME __CURRENT_TIME;
extern unsigned long long common_ticktime__;
IEC_BOOL *bool_output[1024][8];

#define __LOCATED_VAR(type, name, ...) type __##name;
#include "LOCATED_VARIABLES.h"
#undef __LOCATED_VAR
#define __LOCATED_VAR(type, name, ...) type *name = &__##name;
#include "LOCATED_VARIABLES.h"
#undef __LOCATED_VAR

void glueVars() { bool_output[0][1] = (IEC_BOOL *)__QX0_1; }

void updateTime() { __CURRENT_TIME.tv_nsec += common_ticktime__ % 1000000000ULL; }
