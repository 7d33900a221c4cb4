/*
 * A program that starts the counter of the card in shared memory, and waits until it stops.
 *
 *     make run
 *
 * Exit code: 0 done, 1 no answer, 2 not attached.
 */
#include "commram.h"

/* Longest wait for an answer, in ms of emulated time. */
#define PATIENCE_MS 10000u

static commram ram;

/* Waits until these bits of the status have this value. */
static commram_result await_status(CARD *card, uint16_t mask, uint16_t value)
{
    return commram_await(&ram, &card->w_STATUS, sizeof card->w_STATUS, mask, value, PATIENCE_MS);
}

int main(void)
{
    const char *instance = getenv("COMMRAM_INSTANCE");
    char image[128];
    commram_result result;
    CARD *card;
    snprintf(image, sizeof image, "/dev/shm/commram.%s.card1", instance ? instance : "default");
    result = commram_attach(&ram, image, 1);
    if (result != COMMRAM_DONE) {
        fprintf(stderr, "%s: %s\n", image, commram_text(result));
        return 2;
    }
    card = commram_card(&ram);
    result = await_status(card, 0x0001, 0x0001);
    COMMRAM_STORE(card->ud_LIMIT, 20);
    COMMRAM_STORE(card->w_COMMAND, 5);
    /* The firmware polls at once, and not only in its next processor cycle. */
    commram_ring(&ram);
    if (result == COMMRAM_DONE)
        result = COMMRAM_AWAIT(&ram, card->w_COMMAND, 4, PATIENCE_MS);
    if (result == COMMRAM_DONE)
        result = await_status(card, 0x0002, 0x0000);
    if (result == COMMRAM_DONE)
        printf("count %u\n", (unsigned)COMMRAM_LOAD(card->ud_COUNT));
    else
        fprintf(stderr, "%s\n", commram_text(result));
    commram_detach(&ram);
    return result == COMMRAM_DONE ? 0 : 1;
}
