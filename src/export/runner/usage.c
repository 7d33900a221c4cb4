 *
 *     plc IMAGE [EVENT [I_PAR1]]
 *
 * IMAGE    for example /dev/shm/commram.default.line
 * EVENT    number of the event that each scan waits for; without it a scan comes each time the interval of the
 *          program's task is over, by the clock of this computer, which suits an emulator in real time
 * I_PAR1   enables the event with INTR_SET first: of a CPU timer, events 0 and 2, the factor of 50 us
 *
 * An event such as SYNC comes only after the program has set up its bus. If the event has not come for 100 ms of emulated time, or for
 * two intervals of the program's task or two periods of the timer if these are longer, a scan therefore comes each time the interval of
 * the task is over, until the event comes again.
 *
 * In stepped mode emulated time waits for each scan of an event, and for what the board orders (lockstep). TON and the like count
 * emulated time. The device starts and stops the program: a cold start gives all variables their initial values, a warm
 * start all but those declared RETAIN and the retain flags, a hot start none. It ends by SIGINT and SIGTERM.
 *
 * Exit code: 0 ended by a signal, 1 the emulator is gone or has refused something, 2 wrong use or not attached.
 */
#include <signal.h>

