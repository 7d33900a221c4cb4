/* Calls in the order of OpenPLC's main program. SIGTERM replaces the stop command of OpenPLC's pages. At its end the program prints an output. */
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "iec_types.h"
#include "ladder.h"

IEC_BOOL __DEBUG;
pthread_mutex_t bufferLock;
static volatile sig_atomic_t ended;

void openplc_log(char *text)
{
    printf("%s", text);
    fflush(stdout);
}

static void on_signal(int) { ended = 1; }

int main()
{
    signal(SIGTERM, on_signal);
    config_init__();
    glueVars();
    pthread_mutex_init(&bufferLock, NULL);
    initializeHardware();
    updateBuffersIn();
    updateBuffersOut();
    glueVars();
    for (unsigned long tick = 0; !ended; tick++) {
        struct timespec pause = { 0, (long)common_ticktime__ };
        glueVars();
        updateBuffersIn();
        pthread_mutex_lock(&bufferLock);
        config_run__(tick);
        pthread_mutex_unlock(&bufferLock);
        updateBuffersOut();
        updateTime();
        nanosleep(&pause, NULL);
    }
    updateBuffersOut();
    finalizeHardware();
    printf("output %d\n", *bool_output[0][1]);
    return 0;
}
