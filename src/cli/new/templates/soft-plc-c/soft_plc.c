/*
 * A soft-PLC for @title@: writes registers of PLC "@plc@" in the shared memory, and waits for the answer of the firmware.
 *
 *     make run
 *
 * Exit code: 0 done, 1 no answer, 2 not attached.
 */
#include "commram.h"

/* Longest wait for an answer, in ms of emulated time. */
#define PATIENCE_MS 10000u

static commram ram;

int main(void)
{
    const char *instance = getenv("COMMRAM_INSTANCE");
    char image[128];
    commram_result result;
    snprintf(image, sizeof image, "/dev/shm/commram.%s.@plc@", instance ? instance : "default");
    result = commram_attach(&ram, image, 1);
    if (result != COMMRAM_DONE) {
        fprintf(stderr, "%s: %s\n", image, commram_text(result));
        return 2;
    }
@writes_c@
    /* The firmware polls at once, and not only in its next processor cycle. */
    commram_ring(&ram);
    result = COMMRAM_AWAIT(&ram, @answer_c@, @answered@, PATIENCE_MS);
    if (result == COMMRAM_DONE)
        printf("@answer@ = @answered@\n");
    else
        fprintf(stderr, "@answer@: %s\n", commram_text(result));
    commram_detach(&ram);
    return result == COMMRAM_DONE ? 0 : 1;
}
