/* In the form matiec gives to the declarations of PROGRAM START_UP, see program.st. */
#include "accessor.h"
#include "iec_std_lib.h"

typedef struct {
    __DECLARE_LOCATED(WORD, COMMAND)
    __DECLARE_LOCATED(WORD, STATUS)
    __DECLARE_LOCATED(BYTE, CONTROL)
    __DECLARE_LOCATED(DINT, SETPOINT)
    __DECLARE_LOCATED(BOOL, LAMP)
    __DECLARE_LOCATED(UINT, CYCLES)
} START_UP;

void START_UP_init__(START_UP *data__, BOOL retain);
void START_UP_body__(START_UP *data__);
