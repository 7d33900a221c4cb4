/* Located variables of a CS0015 as bits, bytes, words and double words of the same memory. */
#include "iec_std_lib.h"
#include "commram_matiec.h"
COMMRAM_MATIEC_STORAGE
__DECLARE_ARRAY_TYPE(TABLE,WORD,[16])
#ifdef COMMRAM_MATIEC_ACCESS
#include "commram_located.h"
#endif

static struct {
    __DECLARE_LOCATED(BOOL,OUT3)
    __DECLARE_LOCATED(BOOL,OUT8)
    __DECLARE_LOCATED(BOOL,ALSO3)
    __DECLARE_LOCATED(BYTE,HIGH)
    __DECLARE_LOCATED(WORD,OUTS)
    __DECLARE_LOCATED(BYTE,LOW)
    __DECLARE_LOCATED(BOOL,IN0)
    __DECLARE_LOCATED(BOOL,BUTTON)
    __DECLARE_LOCATED(BOOL,SLAVE0)
    __DECLARE_LOCATED(BYTE,SLAVE_HIGH)
    __DECLARE_LOCATED(WORD,SLAVE)
    __DECLARE_LOCATED(DINT,PAIR)
    __DECLARE_LOCATED(TABLE,WORDS)
} p;

static void init(void)
{
    BOOL retain = 0;
    __INIT_LOCATED(BOOL,__QX0_03,p.OUT3,retain)
    __INIT_LOCATED(BOOL,__QX0_08,p.OUT8,retain)
    __INIT_LOCATED(BOOL,__Q0_3,p.ALSO3,retain)
    __INIT_LOCATED(BYTE,__QB1,p.HIGH,retain)
    __INIT_LOCATED(WORD,__QW0,p.OUTS,retain)
    __INIT_LOCATED(BYTE,__IB0,p.LOW,retain)
    __INIT_LOCATED(BOOL,__IX0_0,p.IN0,retain)
    __INIT_LOCATED(BOOL,__IX1_8,p.BUTTON,retain)
    __INIT_LOCATED(BOOL,__MX1010_0,p.SLAVE0,retain)
    __INIT_LOCATED(BYTE,__MB2021,p.SLAVE_HIGH,retain)
    __INIT_LOCATED(WORD,__MW1010,p.SLAVE,retain)
    __INIT_LOCATED(DINT,__MD506,p.PAIR,retain)
    __INIT_LOCATED(TABLE,__MW1000,p.WORDS,retain)
}

int main(int argc, char **argv)
{
    commram ram;
    memset(&ram, 0, sizeof ram);
    init();
#ifdef COMMRAM_MATIEC_BY_NAME
    if (commram_matiec_refused[0])
        return puts(commram_matiec_refused), 2;
#endif
    if (argc < 2 || commram_matiec_attach(&ram, argv[1]) != COMMRAM_DONE)
        return 2;
    __SET_LOCATED(p., OUT3,, 1);
    __SET_LOCATED(p., OUT8,, 1);
    printf("outputs %04X %02X %d %d\n", __GET_LOCATED(p.OUTS,), __GET_LOCATED(p.HIGH,), __GET_LOCATED(p.ALSO3,),
           __GET_LOCATED(p.OUT8,));
    __SET_LOCATED(p., ALSO3,, 0);
    printf("other spelling %04X\n", __GET_LOCATED(p.OUTS,));
    printf("inputs %02X %d %d\n", __GET_LOCATED(p.LOW,), __GET_LOCATED(p.IN0,), __GET_LOCATED(p.BUTTON,));
    __SET_LOCATED(p., SLAVE0,, 1);
    __SET_LOCATED(p., SLAVE_HIGH,, 0x80);
    printf("slave %04X %d %04X\n", __GET_LOCATED(p.SLAVE,), __GET_LOCATED(p.PAIR,), __GET_LOCATED(p.WORDS,.table[10]));
    commram_matiec_detach(&ram);
    return 0;
}
