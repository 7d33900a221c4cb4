#include "iec_std_lib.h"
#include "commram_matiec.h"
#include "POUS.h"

COMMRAM_MATIEC_STORAGE
#include "commram_located.h"

/* Variables and functions that the code of matiec shares with its runtime. */
TIME __CURRENT_TIME;
BOOL __DEBUG = 0;
extern unsigned long long common_ticktime__;
void config_init__(void);
void config_run__(unsigned long tick);

