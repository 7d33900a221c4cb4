/* A program with its configuration and its resource, in the form that matiec generates. */
#include "iec_std_lib.h"
#include "accessor.h"
#include "POUS.h"

__DECLARE_GLOBAL_LOCATION(ETHERNET_DIAGNOSE_BMSTRUCT,__MB3_300000)
__DECLARE_GLOBAL_LOCATED(ETHERNET_DIAGNOSE_BMSTRUCT,CONFIG0,_ETHERNET)

static MAIN INSTANCE1;
extern unsigned long long common_ticktime__;
unsigned long long common_ticktime__ = 2000000ULL * 1ULL; /*ns*/

void config_init__(void) {
  BOOL retain = 0;
  static const ETHERNET_DIAGNOSE_BMSTRUCT temp = {0,0,{{0,0,0,0}},{{0,0,0,0}},0,0,{{0,0}}};
  __INIT_GLOBAL_LOCATED(CONFIG0,_ETHERNET,__MB3_300000,retain)
  *CONFIG0___ETHERNET.value = temp;
  MAIN_init__(&INSTANCE1,retain);
}

void config_run__(unsigned long tick) {
  (void)tick;
  MAIN_body__(&INSTANCE1);
}

void MAIN_init__(MAIN *data__, BOOL retain) {
  __INIT_VAR(data__->SCANS,0,retain)
  __INIT_LOCATED(WORD,__MW3_200000,data__->COMMAND,retain)
  __INIT_LOCATED_VALUE(data__->COMMAND,0)
  __INIT_LOCATED(WORD,__MW3_200002,data__->STATUS,retain)
  __INIT_LOCATED_VALUE(data__->STATUS,0)
  __INIT_LOCATED(BYTE,__MB3_200012_0,data__->CONTROL,retain)
  __INIT_LOCATED_VALUE(data__->CONTROL,0xAA)
  __INIT_LOCATED(BYTE,__MB10000001,data__->SEEN,retain)
  __INIT_LOCATED_VALUE(data__->SEEN,0xEE)
  __INIT_LOCATED(BYTE,__MB10000002,data__->CLOCK,retain)
  __INIT_LOCATED_VALUE(data__->CLOCK,0)
  __INIT_LOCATED(BYTE,__MB10000003,data__->SPEED,retain)
  __INIT_LOCATED_VALUE(data__->SPEED,0)
  __INIT_LOCATED(BOOL,__QX0_1,data__->LAMP,retain)
  __INIT_LOCATED_VALUE(data__->LAMP,0)
  __INIT_EXTERNAL(ETHERNET_DIAGNOSE_BMSTRUCT,_ETHERNET,data__->_ETHERNET,retain)
}

/*
 * The first scan on an image copies a register into a retain flag, and the speed of the link into another flag: neither has an
 * initial value of config_init__. Then the program starts the node, with two writes to a register in one scan.
 */
void MAIN_body__(MAIN *data__) {
  if (__GET_VAR(data__->SCANS,) == 0) {
    __SET_LOCATED(data__->,SEEN,,__GET_LOCATED(data__->CONTROL,) + 1);
  }
  __SET_VAR(data__->,SCANS,,1);
  __SET_LOCATED(data__->,SPEED,,__GET_EXTERNAL(data__->_ETHERNET,.W_SPEED));
  __SET_LOCATED(data__->,CLOCK,,(BYTE)(__CURRENT_TIME.tv_nsec / 1000000));
  if (__GET_LOCATED(data__->STATUS,) == 0x0001) {
    __SET_LOCATED(data__->,COMMAND,,0x0000);
    __SET_LOCATED(data__->,COMMAND,,0x0001);
  } else if (__GET_LOCATED(data__->STATUS,) == 0x0002) {
    __SET_LOCATED(data__->,LAMP,,1);
  }
}

#if defined(__cplusplus)
static_assert(__is_same(decltype(MAIN::COMMAND.value), volatile WORD *), "not volatile");
#endif
