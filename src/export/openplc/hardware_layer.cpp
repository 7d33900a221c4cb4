 *
 * A hardware layer for OpenPLC: it maps the registers under the program's located variables. Save it as
 * webserver/core/hardware_layer.cpp; docs/guide/plc-programs.md has the rest.
 *
 * The environment variable COMMRAM_IMAGE names the image, /dev/shm/commram.default.line if there is none. The device there
 * starts and stops the program; while it is stopped its scans do not reach any register. TON and the like count emulated time.
 */
#include "iec_types.h"
#include "ladder.h"
#define COMMRAM_OPENPLC_LAYER
#include "commram_openplc.h"

extern IEC_TIMESPEC __CURRENT_TIME;

COMMRAM_MATIEC_STORAGE
static commram ram;
static commram_result last = COMMRAM_GONE;

void updateBuffersIn()
{
    const char *named = getenv("COMMRAM_IMAGE"), *image = named ? named : "/dev/shm/commram.default.line";
    pthread_mutex_lock(&bufferLock);
    commram_result result = commram_matiec_keep(&ram, image, config_init__);
    if (result == COMMRAM_DONE)
        COMMRAM_MATIEC_TIME(&ram, __CURRENT_TIME);
    pthread_mutex_unlock(&bufferLock);
    if (result != last) {
        char line[300];
        snprintf(line, sizeof line, "%s: %s\n", image, result ? commram_text(result) : "attached");
        openplc_log(line);
    }
    last = result;
}

void updateBuffersOut()
{
    if (ram.base)
        commram_ring(&ram);
}

void initializeHardware() {}

void finalizeHardware() { commram_matiec_leave(&ram); }
