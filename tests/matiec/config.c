/* A program, its configuration and its resource in matiec's form. */
#include "iec_std_lib.h"
#include "accessor.h"
#include "POUS.h"

__DECLARE_GLOBAL_LOCATION(ETHERNET_DIAGNOSE_BMSTRUCT,__MB3_300000)
__DECLARE_GLOBAL_LOCATED(ETHERNET_DIAGNOSE_BMSTRUCT,CONFIG,_ETHERNET)

static START_UP INSTANCE1;
unsigned long long common_ticktime__ = 2000000ULL * 1ULL; /*ns*/

void config_init__(void) {
  BOOL retain = 0;
  static const ETHERNET_DIAGNOSE_BMSTRUCT temp = {0,0,{{0,0,0,0}},{{0,0,0,0}},0,0,{{0,0}}};
  __INIT_GLOBAL_LOCATED(CONFIG,_ETHERNET,__MB3_300000,retain)
  *CONFIG___ETHERNET.value = temp;
  START_UP_init__(&INSTANCE1,retain);
}

void config_run__(unsigned long tick) {
  (void)tick;
  START_UP_body__(&INSTANCE1);
}

void START_UP_init__(START_UP *data__, BOOL retain) {
  __INIT_VAR(data__->SCANS,0,retain)
  __INIT_LOCATED(WORD,__MW3_200000,data__->COMMAND,retain)
  __INIT_LOCATED_VALUE(data__->COMMAND,0)
  __INIT_LOCATED(WORD,__MW3_200002,data__->STATUS,retain)
  __INIT_LOCATED_VALUE(data__->STATUS,0)
  __INIT_LOCATED(BYTE,__MB3_200012_0,data__->CONTROL,retain)
  __INIT_LOCATED_VALUE(data__->CONTROL,0xAA)
  __INIT_LOCATED(DINT,__MD3_200052,data__->SETPOINT,retain)
  __INIT_LOCATED_VALUE(data__->SETPOINT,4711)
  __INIT_LOCATED(BYTE,__MB10000001,data__->FLAG,retain)
  __INIT_LOCATED_VALUE(data__->FLAG,0xEE)
  __INIT_LOCATED(DINT,__MD10000004,data__->SEEN,retain)
  __INIT_LOCATED_VALUE(data__->SEEN,0)
  __INIT_LOCATED(WORD,__MW10000008,data__->SPEED,retain)
  __INIT_LOCATED_VALUE(data__->SPEED,0)
  __INIT_LOCATED(BOOL,__QX0_1,data__->LAMP,retain)
  __INIT_LOCATED_VALUE(data__->LAMP,0)
  __INIT_LOCATED(UINT,__QW7,data__->CYCLES,retain)
  __INIT_LOCATED_VALUE(data__->CYCLES,0)
  __INIT_EXTERNAL(ETHERNET_DIAGNOSE_BMSTRUCT,_ETHERNET,data__->_ETHERNET,retain)
}

/*
 * The first scan copies the registers into retain flags: none has an initial value of config_init__. Then the program
 * starts the node, with two writes to a register in one scan.
 */
void START_UP_body__(START_UP *data__) {
  if (__GET_VAR(data__->SCANS,) == 0) {
    __SET_LOCATED(data__->,FLAG,,__GET_LOCATED(data__->CONTROL,));
    __SET_LOCATED(data__->,SEEN,,__GET_LOCATED(data__->SETPOINT,) + 1);
    __SET_LOCATED(data__->,SPEED,,__GET_EXTERNAL(data__->_ETHERNET,.W_SPEED));
  }
  __SET_VAR(data__->,SCANS,,1);
  __SET_LOCATED(data__->,CYCLES,,__GET_LOCATED(data__->CYCLES,) + 1);
  if (__GET_LOCATED(data__->STATUS,) == 0x0001) {
    __SET_LOCATED(data__->,COMMAND,,0x0000);
    __SET_LOCATED(data__->,COMMAND,,0x0001);
  } else if (__GET_LOCATED(data__->STATUS,) == 0x0002) {
    __SET_LOCATED(data__->,LAMP,,1);
  }
}

#ifdef COMMRAM_MATIEC_ACCESS
/* Both writes to COMMAND reach the register. */
_Static_assert(_Generic(&((START_UP *)0)->COMMAND.value, volatile WORD **: 1, default: 0), "not volatile");
_Static_assert(_Generic(&((START_UP *)0)->_ETHERNET.value, volatile ETHERNET_DIAGNOSE_BMSTRUCT **: 1, default: 0),
               "not volatile");
#endif
