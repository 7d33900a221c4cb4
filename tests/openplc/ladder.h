/*
 * Stub for the file of this name in OpenPLC. It declares the functions and variables that OpenPLC's main program and a
 * hardware layer share.
 */
#include <pthread.h>
#include <stdint.h>

typedef uint8_t IEC_BOOL;
extern IEC_BOOL *bool_output[1024][8];
extern pthread_mutex_t bufferLock;
extern unsigned long long common_ticktime__;

void config_init__(void);
void config_run__(unsigned long tick);
void glueVars();
void updateTime();
void initializeHardware();
void finalizeHardware();
void updateBuffersIn();
void updateBuffersOut();
extern "C" void openplc_log(char *text);
