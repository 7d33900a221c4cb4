#include "iec_std_lib.h"
#include "commram_matiec.h"
#include "POUS.h"

COMMRAM_MATIEC_STORAGE
#include "commram_located.h"

/* What matiec's code wants of its runtime, and gives to it. */
TIME __CURRENT_TIME;
BOOL __DEBUG = 0;
extern unsigned long long common_ticktime__;
void config_init__(void);
void config_run__(unsigned long tick);

