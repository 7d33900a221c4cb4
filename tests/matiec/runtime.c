/* What an application writes around its program: storage, initial values, attaching, scans. */
#include "iec_std_lib.h"
#include "commram_matiec.h"
COMMRAM_MATIEC_STORAGE
#include "LOCATED_VARIABLES.h"
#include "program.h"

int main(int argc, char **argv)
{
    static START_UP program;
    static commram ram;
    commram_result result;
    int scan;
    if (argc != 2)
        return 2;
    START_UP_init__(&program, 0);
    printf("initial values: %02X %ld\n", *__MB3_200012, (long)*__MD3_200052);
    result = commram_matiec_attach(&ram, argv[1]);
    if (result != COMMRAM_DONE) {
        fprintf(stderr, "%s: %s\n", argv[1], commram_text(result));
        return 2;
    }
    printf("registers: %02X %ld\n", *__MB3_200012, (long)*__MD3_200052);
    for (scan = 0; scan < 10000 && !*__QX0_1; scan++) {
        START_UP_body__(&program);
        commram_ring(&ram);
        usleep(1000);
        result = commram_check(&ram);
        if (result != COMMRAM_DONE)
            break;
    }
    printf("status %04X, lamp %d, cycles counted %d\n", *__MW3_200002, *__QX0_1, *__MW7 > 0);
    commram_matiec_detach(&ram);
    printf("detached: %04X\n", *__MW3_200002);
    return *__MW3_200002;
}
