/*
 * A soft-PLC in C, also compiled as C++: brings CANsync node 2 from start to active operation, waits until the
 * drive with slave number 1 has locked, and sends it a reference value until its actual value is the same.
 *
 *     commram export c --output commram.h
 *     cc -Wall -Wextra -I. tools/c/soft_plc.c -o soft_plc
 *     commram with -- sh -c './soft_plc /dev/shm/commram.$COMMRAM_INSTANCE.line 1000'
 *
 * Exit code: 0 done, 1 the emulator did not answer as it should, 2 wrong use or not attached.
 */
#include "commram.h"

#define DRIVE 1
#define STATE_MS 10000u

static commram ram;

/* Prints the error with the value that was found, and ends the program. */
static void stop(const char *what, unsigned found, commram_result result)
{
    fprintf(stderr, "%s: %s (16#%04X)\n", what, commram_text(result), found);
    commram_detach(&ram);
    exit(1);
}

/* Writes a command and waits for the state to which it leads. */
static void command(CANsync_MA_CTRL_BMSTRUCT *node, uint16_t command, uint16_t state)
{
    commram_result result;
    COMMRAM_STORE(node->w_CPU_CONTROL, command);
    commram_ring(&ram);
    result = COMMRAM_AWAIT(&ram, node->w_OPTION_STATUS, state, STATE_MS);
    if (result != COMMRAM_DONE)
        stop("w_OPTION_STATUS", COMMRAM_LOAD(node->w_OPTION_STATUS), result);
    printf("w_CPU_CONTROL 16#%04X -> w_OPTION_STATUS 16#%04X\n", command, state);
}

/* Writes the initialization data of a master at 500 kbit/s that expects one slave. */
static void initialization_data(CANsync_INIT_BMSTRUCT *init)
{
    COMMRAM_STORE(init->b_MA_SL_MODE, 0x00);
    COMMRAM_STORE(init->b_AC, 0xFF);
    COMMRAM_STORE(init->b_AM, 0xFF);
    COMMRAM_STORE(init->b_BT_0, 0x00);
    COMMRAM_STORE(init->b_BT_1, 0x1C);
    COMMRAM_STORE(init->b_OUTPUT_CONTROL, 0xFA);
    COMMRAM_STORE(init->b_CLOCK_DIVIDER, 0x07);
    COMMRAM_STORE(init->b_TIME_PATTERN, 2);
    COMMRAM_STORE(init->a_SL_TYP[DRIVE], COMMRAM_SL_TYP_EXPECTED);
}

/* Maps value 0 to words 0 and 1 of frame 1, in both directions. */
static void mapping(CANsync_MA_CTRL_BMSTRUCT *node)
{
    const uint8_t low = COMMRAM_CFG_WORD_ASSIGNED;
    const uint8_t high = COMMRAM_CFG_WORD_ASSIGNED | COMMRAM_CFG_WORD_HIGH_WORD;
    COMMRAM_STORE(node->_CFG_WRC_WORD.b_CFG_WRC1_WORD0, low);
    COMMRAM_STORE(node->_CFG_WRC_WORD.b_CFG_WRC1_WORD1, high);
    COMMRAM_STORE(node->a_CFG_RDC_WORD[DRIVE].b_CFG_RDC1_WORD0, low);
    COMMRAM_STORE(node->a_CFG_RDC_WORD[DRIVE].b_CFG_RDC1_WORD1, high);
    COMMRAM_STORE(node->b_CTRLREG_RD_ORDER_RDC1, DRIVE);
}

/* Stores the data first, then the control register. The firmware answers 16#04. */
static void send(CANsync_MA_CTRL_BMSTRUCT *node, int32_t value)
{
    commram_result result;
    COMMRAM_STORE(node->a_WR_VALUE[0], value);
    COMMRAM_STORE(node->b_CTRLREG_WRC1, COMMRAM_SEND_DATA_WRITTEN_TO_BE_SENT);
    commram_ring(&ram);
    result = COMMRAM_AWAIT(&ram, node->b_CTRLREG_WRC1, COMMRAM_SEND_TAKEN_OVER_AND_SENT, STATE_MS);
    if (result != COMMRAM_DONE)
        stop("b_CTRLREG_WRC1", COMMRAM_LOAD(node->b_CTRLREG_WRC1), result);
}

int main(int argc, char **argv)
{
    CANsync_MA_CTRL_BMSTRUCT *node;
    commram_result result;
    int32_t value;
    int tries;
    if (argc != 3) {
        fprintf(stderr, "usage: soft_plc IMAGE VALUE\n");
        return 2;
    }
    result = commram_attach(&ram, argv[1], 1);
    if (result != COMMRAM_DONE) {
        fprintf(stderr, "%s: %s\n", argv[1], commram_text(result));
        return 2;
    }
    value = (int32_t)strtol(argv[2], NULL, 0);
    node = commram_CANsync_CTRL_MA(&ram);

    command(node, 0x0000, 0x0001);
    command(node, 0x0001, 0x0002);
    initialization_data(commram_CANsync_INIT_MA(&ram));
    command(node, 0x0002, 0x0003);
    mapping(node);
    command(node, 0x0020, 0x0043);
    result = COMMRAM_AWAIT(&ram, node->a_STAT_SL[DRIVE],
                           COMMRAM_STAT_SL_RESPONSE | COMMRAM_STAT_SL_SYNCHRONIZED, STATE_MS);
    if (result != COMMRAM_DONE)
        stop("a_STAT_SL[1]", COMMRAM_LOAD(node->a_STAT_SL[DRIVE]), result);
    command(node, 0x0040, 0x0080);

    for (tries = 0; tries < 100; tries++) {
        send(node, value);
        if (COMMRAM_LOAD(node->a_RD_BMARRAY[DRIVE][0]) == value) {
            printf("a_RD_BMARRAY[1][0] = %ld\n", (long)value);
            commram_detach(&ram);
            return 0;
        }
    }
    stop("a_RD_BMARRAY[1][0]", (unsigned)COMMRAM_LOAD(node->a_RD_BMARRAY[DRIVE][0]), COMMRAM_TIMEOUT);
    return 1;
}
