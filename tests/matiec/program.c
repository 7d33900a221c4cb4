/* In the form matiec gives to the body of PROGRAM START_UP, see program.st. */
#include "program.h"

void START_UP_init__(START_UP *data__, BOOL retain)
{
    __INIT_LOCATED(WORD, __MW3_200000, data__->COMMAND, retain)
    __INIT_LOCATED_VALUE(data__->COMMAND, 0)
    __INIT_LOCATED(WORD, __MW3_200002, data__->STATUS, retain)
    __INIT_LOCATED_VALUE(data__->STATUS, 0)
    __INIT_LOCATED(BYTE, __MB3_200012, data__->CONTROL, retain)
    __INIT_LOCATED_VALUE(data__->CONTROL, 0xAA)
    __INIT_LOCATED(DINT, __MD3_200052, data__->SETPOINT, retain)
    __INIT_LOCATED_VALUE(data__->SETPOINT, 4711)
    __INIT_LOCATED(BOOL, __QX0_1, data__->LAMP, retain)
    __INIT_LOCATED_VALUE(data__->LAMP, 0)
    __INIT_LOCATED(UINT, __MW7, data__->CYCLES, retain)
    __INIT_LOCATED_VALUE(data__->CYCLES, 0)
}

void START_UP_body__(START_UP *data__)
{
    __SET_LOCATED(data__->, CYCLES, , __GET_LOCATED(data__->CYCLES, ) + 1);
    if (__GET_LOCATED(data__->STATUS, ) == 0x0001) {
        __SET_LOCATED(data__->, COMMAND, , 0x0000);
        __SET_LOCATED(data__->, COMMAND, , 0x0001);
    } else if (__GET_LOCATED(data__->STATUS, ) == 0x0002) {
        __SET_LOCATED(data__->, LAMP, , 1);
    }
}

#ifdef COMMRAM_MATIEC_ACCESS
/* Both writes to COMMAND are made. */
_Static_assert(_Generic(&((START_UP *)0)->COMMAND.value, volatile WORD **: 1, default: 0), "not volatile");
#endif
