/*
 * Drives the device tools/devices/netx-dpm with Hilscher's library libcifx, which takes the image for the dual-port memory of a card.
 *
 *     oracle IMAGE          in real time
 *     oracle IMAGE stepped  in emulated time: the time waits for the library, and its pauses and clock are emulated
 *     oracle IMAGE slave    in real time, only the exchange with the DP slave of the card
 *
 * Prints a line for each step, and ends with exit code 1 at the first step with another result than expected. tools/netx/run builds it.
 */
#define _GNU_SOURCE
#include "commram.h"
#include "cifxlinux.h"
#include "cifXErrors.h"
#include "cifXUser.h"
#include <stdarg.h>

enum { PD0 = 5760, PD1 = 64, TIMEOUT_MS = 2000, LONGEST_TURN_MS = 60000 };

static commram ram;
static commram_task task;
static int is_stepped;
static CIFXHANDLE driver, device, channel;

/* The linker replaces the library's pauses and its clock by these functions. */
void __real_OS_Sleep(uint32_t ms);
uint32_t __real_OS_GetMilliSecCounter(void);

static uint64_t emulated_us(void) { return COMMRAM_LOAD(ram.header->virtual_time_us); }

static void fail(const char *what, ...)
{
    va_list args;
    va_start(args, what);
    fflush(stdout);
    vfprintf(stderr, what, args);
    fputc('\n', stderr);
    va_end(args);
    exit(1);
}

void __wrap_OS_Sleep(uint32_t ms)
{
    commram_result result;
    if (!is_stepped) {
        __real_OS_Sleep(ms);
        return;
    }
    /* For a pause of 0 ms, the library would pause for 50 us. */
    result = commram_run(&task, ms ? ms * 1000 : 50, LONGEST_TURN_MS);
    if (result != COMMRAM_DONE)
        fail("lockstep: %s", commram_text(result));
}

uint32_t __wrap_OS_GetMilliSecCounter(void)
{
    return is_stepped ? (uint32_t)(emulated_us() / 1000) : __real_OS_GetMilliSecCounter();
}

static void report(const char *text, ...)
{
    va_list args;
    if (is_stepped)
        printf("%10.6f s  ", emulated_us() / 1e6);
    va_start(args, text);
    vprintf(text, args);
    va_end(args);
    putchar('\n');
}

static void expect(const char *what, int32_t found, int32_t right)
{
    char text[200] = "no error";
    if (found == right)
        return;
    if (found)
        xDriverGetErrorDescription(found, text, sizeof text);
    fail("%s: 16#%08X (%s) instead of 16#%08X", what, (unsigned)found, text, (unsigned)right);
}

static void expect_number(const char *what, unsigned found, unsigned right)
{
    if (found != right)
        fail("%s: 16#%X instead of 16#%X", what, found, right);
}

/* Sends a packet. Stores the answer in `answer`, and returns its status. */
static uint32_t transfer(int to_channel, uint32_t command, const void *data, uint32_t length, CIFX_PACKET *answer)
{
    static uint32_t number;
    CIFX_PACKET packet;
    memset(&packet, 0, sizeof packet);
    packet.tHeader.ulDest = to_channel ? 0x20 : 0;
    packet.tHeader.ulSrc = 0x4711;
    packet.tHeader.ulId = ++number;
    packet.tHeader.ulCmd = command;
    packet.tHeader.ulLen = length;
    memcpy(packet.abData, data, length);
    if (to_channel) {
        expect("xChannelPutPacket", xChannelPutPacket(channel, &packet, TIMEOUT_MS), CIFX_NO_ERROR);
        expect("xChannelGetPacket", xChannelGetPacket(channel, sizeof *answer, answer, TIMEOUT_MS), CIFX_NO_ERROR);
    } else {
        expect("xSysdevicePutPacket", xSysdevicePutPacket(device, &packet, TIMEOUT_MS), CIFX_NO_ERROR);
        expect("xSysdeviceGetPacket", xSysdeviceGetPacket(device, sizeof *answer, answer, TIMEOUT_MS), CIFX_NO_ERROR);
    }
    expect_number("command of the answer", answer->tHeader.ulCmd, command | 1);
    expect_number("number of the answer", answer->tHeader.ulId, number);
    expect_number("sender of the request", answer->tHeader.ulSrc, 0x4711);
    return answer->tHeader.ulState;
}

static uint32_t word(const CIFX_PACKET *packet, int index)
{
    uint32_t value;
    memcpy(&value, packet->abData + 4 * index, sizeof value);
    return value;
}

/* Checks that the outputs of both areas come back as inputs in their full length. */
static void exchange(const char *mode, unsigned rounds)
{
    static unsigned char out[PD0], in[PD0];
    static unsigned seed;
    unsigned round, area, i, tries;
    for (round = 0; round < rounds; round++) {
        for (area = 0; area < 2; area++) {
            unsigned length = area ? PD1 : PD0;
            seed++;
            for (i = 0; i < length; i++)
                out[i] = (unsigned char)(seed * 7 + i + area);
            expect("xChannelIOWrite", xChannelIOWrite(channel, area, 0, length, out, TIMEOUT_MS), CIFX_NO_ERROR);
            /* The first inputs are from the previous exchange. */
            for (tries = 0; tries < 20; tries++) {
                expect("xChannelIORead", xChannelIORead(channel, area, 0, length, in, TIMEOUT_MS), CIFX_NO_ERROR);
                if (!memcmp(in, out, length))
                    break;
                __wrap_OS_Sleep(1);
            }
            if (tries == 20)
                fail("%s: the inputs of area %u are not the outputs", mode, area);
        }
    }
    report("process data %s: %u times 5760 and 64 bytes", mode, rounds);
}

static void set_modes(unsigned in, unsigned out)
{
    uint32_t data[5] = { 0 };
    CIFX_PACKET answer;
    data[0] = in;
    data[1] = out;
    expect_number("set the handshakes", transfer(1, 0x2F34, data, sizeof data, &answer), 0);
}

static uint32_t communication_error(void)
{
    uint32_t error;
    expect("xChannelCommonStatusBlock",
           xChannelCommonStatusBlock(channel, CIFX_CMD_READ_DATA, 8, sizeof error, &error), CIFX_NO_ERROR);
    return error;
}

static void bus(uint32_t command, uint32_t state)
{
    uint32_t found = 99;
    expect("xChannelBusState", xChannelBusState(channel, command, &found, TIMEOUT_MS), CIFX_NO_ERROR);
    expect_number("state of the bus", found, state);
}

static void start_bus(void)
{
    uint32_t state = 0;
    expect("xChannelHostState", xChannelHostState(channel, CIFX_HOST_STATE_READY, &state, TIMEOUT_MS), CIFX_NO_ERROR);
    bus(CIFX_BUS_STATE_ON, CIFX_BUS_STATE_ON);
}

/* Waits until the card has a firmware. Before, the library would try a download. */
static void await_firmware(void)
{
    unsigned waited_ms;
    for (waited_ms = 0; !(COMMRAM_LOAD(commram_hsk(&ram)->tSysFlags.bNetxFlags) & 1); waited_ms++) {
        if (waited_ms > TIMEOUT_MS)
            fail("the firmware does not start");
        __wrap_OS_Sleep(1);
    }
}

static void open_card(unsigned char *dpm)
{
    static struct CIFX_DEVICE_T card;
    static struct CIFX_LINUX_INIT init;
    BOARD_INFORMATION board;
    SYSTEM_CHANNEL_SYSTEM_INFO_BLOCK info;
    memset(&board, 0, sizeof board);
    card.dpm = dpm;
    card.dpmlen = 16384;
    card.uio_num = card.uio_fd = -1;
    init.init_options = CIFX_DRIVER_INIT_NOSCAN;
    init.base_dir = "/nonexistent";
    /* With this setting, the library starts no thread. So all accesses have the order of this program. */
    init.poll_interval = (unsigned long)CIFX_POLLINTERVAL_DISABLETHREAD;
    init.user_card_cnt = 1;
    init.user_cards = &card;
    expect("cifXDriverInit", cifXDriverInit(&init), CIFX_NO_ERROR);
    expect("xDriverOpen", xDriverOpen(&driver), CIFX_NO_ERROR);
    expect("xDriverEnumBoards", xDriverEnumBoards(driver, 0, sizeof board, &board), CIFX_NO_ERROR);
    expect("start of the card", board.lBoardError, CIFX_NO_ERROR);
    expect_number("channels", board.ulChannelCnt, 1);
    report("driver: board %s, device %u, serial number %u, %u bytes, %u channel", board.abBoardName,
           board.tSystemInfo.ulDeviceNumber, board.tSystemInfo.ulSerialNumber, board.ulDpmTotalSize, board.ulChannelCnt);
    expect("xSysdeviceOpen", xSysdeviceOpen(driver, "cifX0", &device), CIFX_NO_ERROR);
    expect("xSysdeviceInfo", xSysdeviceInfo(device, CIFX_INFO_CMD_SYSTEM_INFO_BLOCK, sizeof info, &info), CIFX_NO_ERROR);
    report("system device: cookie %.4s, device class 16#%X", (char *)info.abCookie, info.usDeviceClass);
}

static void open_channel(void)
{
    CHANNEL_INFORMATION info;
    expect("xChannelOpen", xChannelOpen(driver, "cifX0", 0, &channel), CIFX_NO_ERROR);
    expect("xChannelInfo", xChannelInfo(channel, sizeof info, &info), CIFX_NO_ERROR);
    expect_number("input areas", info.ulIOInAreaCnt, 2);
    expect_number("output areas", info.ulIOOutAreaCnt, 2);
    report("channel 0: firmware %.*s %u.%u.%u of %u-%02u-%02u, mailbox of %u bytes", info.bFWNameLength, info.abFWName,
           info.usFWMajor, info.usFWMinor, info.usFWBuild, info.usFWYear, info.bFWMonth, info.bFWDay, info.ulMailboxSize);
}

static void packets(void)
{
    CIFX_PACKET answer;
    uint32_t data[2] = { 2, 5 }, state = 99, received, sent;
    unsigned round;
    expect_number("hardware identification", transfer(0, 0x1EB8, NULL, 0, &answer), 0);
    report("packet: hardware identification, chip %u", word(&answer, 6));
    expect_number("information about a block", transfer(0, 0x1EF8, data, 8, &answer), 0);
    report("packet: block 5 of area 2 begins at 16#%X and has %u bytes", word(&answer, 3), word(&answer, 4));
    expect_number("no such block", (data[1] = 9, transfer(0, 0x1EF8, data, 8, &answer)), 0xC0000009);
    expect_number("unknown command", transfer(0, 0x1FFE, NULL, 0, &answer), 0xC0000004);
    expect_number("wrong length", transfer(1, 0x2F30, NULL, 0, &answer), 0xC0000007);
    expect_number("register an application", transfer(1, 0x2F10, NULL, 0, &answer), 0);
    expect_number("register it twice", transfer(1, 0x2F10, NULL, 0, &answer), 0xC0000201);
    expect_number("unregister it", transfer(1, 0x2F12, NULL, 0, &answer), 0);
    for (round = 0; round < 20; round++)
        expect_number("time of the watchdog", transfer(1, 0x2F02, NULL, 0, &answer), 0);
    /* The device sees at its next cycle that the last answer was read. */
    for (round = 0; round < 1000; round++) {
        expect("xChannelGetMBXState", xChannelGetMBXState(channel, &received, &sent), CIFX_NO_ERROR);
        if (!received)
            break;
        __wrap_OS_Sleep(1);
    }
    expect_number("waiting packets", received, 0);
    report("packets: errors are answered, 20 packets in a row, watchdog %u ms", word(&answer, 0));
    expect("xChannelConfigLock", xChannelConfigLock(channel, CIFX_CONFIGURATION_LOCK, &state, TIMEOUT_MS), CIFX_NO_ERROR);
    expect("xChannelConfigLock", xChannelConfigLock(channel, CIFX_CONFIGURATION_GETLOCKSTATE, &state, TIMEOUT_MS), CIFX_NO_ERROR);
    expect_number("lock of the configuration", state, 1);
    expect("xChannelConfigLock", xChannelConfigLock(channel, CIFX_CONFIGURATION_UNLOCK, &state, TIMEOUT_MS), CIFX_NO_ERROR);
    report("configuration locked and unlocked");
}

static void process_data(void)
{
    unsigned char byte = 1;
    expect("outputs without a bus", xChannelIOWrite(channel, 0, 0, 1, &byte, TIMEOUT_MS), CIFX_DEV_NO_COM_FLAG);
    start_bus();
    report("bus on, communicating");
    exchange("buffered, host controlled", 10);
    set_modes(2, 2);
    exchange("buffered, device controlled", 10);
    set_modes(3, 3);
    exchange("uncontrolled", 10);
    set_modes(2, 4);
    exchange("inputs device controlled, outputs host controlled", 10);
    set_modes(4, 4);
    exchange("buffered, host controlled", 10);
    bus(CIFX_BUS_STATE_OFF, CIFX_BUS_STATE_OFF);
    report("bus off");
    bus(CIFX_BUS_STATE_ON, CIFX_BUS_STATE_ON);
}

static void watchdog(void)
{
    CIFX_PACKET answer;
    /* In real time this program may wait for longer than 100 ms on a busy machine. */
    uint32_t trigger, time_ms = is_stepped ? 100 : 1000, state, before = 0;
    unsigned char byte = 1;
    unsigned round, waited_ms;
    int32_t result;
    expect_number("set the time of the watchdog", transfer(1, 0x2F04, &time_ms, 4, &answer), 0);
    for (round = 0; round < 20; round++) {
        expect("xChannelWatchdog", xChannelWatchdog(channel, CIFX_WATCHDOG_START, &trigger), CIFX_NO_ERROR);
        if (is_stepped && trigger == before)
            fail("the device has not counted ulHostWatchdog up");
        before = trigger;
        __wrap_OS_Sleep(20);
    }
    expect_number("error", communication_error(), 0);
    report("watchdog of %u ms, triggered 20 times: communicating", time_ms);
    for (waited_ms = 0; !communication_error(); waited_ms++) {
        if (waited_ms > 10 * time_ms)
            fail("the watchdog has not expired within ten times its time");
        __wrap_OS_Sleep(1);
    }
    expect("outputs after the watchdog", xChannelIOWrite(channel, 0, 0, 1, &byte, TIMEOUT_MS), CIFX_DEV_NO_COM_FLAG);
    report("watchdog expired: error 16#%08X, no communication", communication_error());
    result = xChannelBusState(channel, CIFX_BUS_STATE_ON, &state, 50);
    expect("bus before the channel initialization", result, CIFX_DEV_NO_COM_FLAG);
    expect("xChannelReset", xChannelReset(channel, CIFX_CHANNELINIT, TIMEOUT_MS), CIFX_NO_ERROR);
    expect_number("error after the initialization", communication_error(), 0);
    start_bus();
    exchange("after the channel initialization", 3);
    expect("xChannelWatchdog", xChannelWatchdog(channel, CIFX_WATCHDOG_START, &trigger), CIFX_NO_ERROR);
    __wrap_OS_Sleep(10);
    expect("xChannelWatchdog", xChannelWatchdog(channel, CIFX_WATCHDOG_STOP, &trigger), CIFX_NO_ERROR);
    /* After a channel initialization the time of the watchdog is still the same. */
    __wrap_OS_Sleep(time_ms * 3 / 2);
    expect_number("error after the end of the supervision", communication_error(), 0);
    report("watchdog stopped: communicating without triggers");
}

static void system_reset(void)
{
    CIFX_PACKET answer;
    expect("xSysdeviceReset", xSysdeviceReset(device, 5000), CIFX_NO_ERROR);
    /* The channel is ready a short time after the system, so the program waits. */
    __wrap_OS_Sleep(50);
    expect_number("hardware identification", transfer(0, 0x1EB8, NULL, 0, &answer), 0);
    start_bus();
    exchange("after a reset of the system", 3);
}

/* Sends outputs to the DP slave until its program has answered with inputs. */
static void slave(void)
{
    static const unsigned char out[2] = { 0x12, 0x34 }, right[2] = { 0x56, 0x78 };
    unsigned char in[2] = { 0, 0 };
    unsigned waited_ms;
    start_bus();
    for (waited_ms = 0; memcmp(in, right, sizeof right); waited_ms += 10) {
        if (waited_ms > LONGEST_TURN_MS)
            fail("the inputs of the slave are %02X %02X", in[0], in[1]);
        expect("xChannelIOWrite", xChannelIOWrite(channel, 0, 0, sizeof out, (void *)out, TIMEOUT_MS), CIFX_NO_ERROR);
        expect("xChannelIORead", xChannelIORead(channel, 0, 0, sizeof in, in, TIMEOUT_MS), CIFX_NO_ERROR);
        __wrap_OS_Sleep(10);
    }
    report("DP slave: outputs %02X %02X, inputs %02X %02X", out[0], out[1], in[0], in[1]);
}

int main(int argc, char **argv)
{
    commram_result result;
    int has_slave = argc == 3 && !strcmp(argv[2], "slave");
    setvbuf(stdout, NULL, _IOLBF, 0);
    is_stepped = argc == 3 && !strcmp(argv[2], "stepped");
    if (argc != 2 && !is_stepped && !has_slave) {
        fprintf(stderr, "usage: oracle IMAGE [stepped|slave]\n");
        return 2;
    }
    result = commram_attach(&ram, argv[1], 1);
    if (result != COMMRAM_DONE) {
        fprintf(stderr, "%s: %s\n", argv[1], commram_text(result));
        return 2;
    }
    if (is_stepped) {
        result = commram_join(&ram, &task, COMMRAM_SEAT_ORDERS, LONGEST_TURN_MS, LONGEST_TURN_MS);
        if (result != COMMRAM_DONE)
            fail("lockstep: %s", commram_text(result));
        report("joined");
        if ((result = commram_turn(&task, LONGEST_TURN_MS)) != COMMRAM_DONE)
            fail("lockstep: %s", commram_text(result));
    }
    await_firmware();
    open_card(ram.base + 4096);
    open_channel();
    if (has_slave) {
        slave();
    } else {
        packets();
        process_data();
        watchdog();
        system_reset();
    }
    xChannelClose(channel);
    xSysdeviceClose(device);
    xDriverClose(driver);
    cifXDriverDeinit();
    report("done");
    if (is_stepped) {
        commram_done(&task);
        commram_leave(&task);
    }
    commram_detach(&ram);
    return 0;
}
