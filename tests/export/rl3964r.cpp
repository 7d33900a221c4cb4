// A partner of the procedure 3964R with rl3964R, the class of the library rllib of pvbrowser.
//
//   rl3964r DEVICE high|low echo COUNT      sends each received block back, and ends after COUNT blocks
//   rl3964r DEVICE high|low send BLOCK...   sends blocks, in hexadecimal digits, one after each received block, and prints
//                                           the received blocks
#include "rl3964r.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <condition_variable>
#include <deque>
#include <mutex>
#include <string>

static std::mutex lock;
static std::condition_variable changed;
static std::deque<std::string> received;

static void take(const unsigned char *octets, int count)
{
    std::lock_guard<std::mutex> held(lock);
    received.emplace_back(reinterpret_cast<const char *>(octets), count);
    changed.notify_one();
}

static std::string next()
{
    std::unique_lock<std::mutex> held(lock);
    changed.wait(held, [] { return !received.empty(); });
    std::string block = received.front();
    received.pop_front();
    for (unsigned char octet : block)
        printf("%02X", octet);
    printf("\n");
    fflush(stdout);
    return block;
}

static int send(rl3964R &partner, const std::string &block)
{
    std::string copy = block;
    // A block of the other side can come first, so the procedure refuses a new one for a moment.
    for (int attempt = 0; attempt < 5; attempt++) {
        if (partner.write(reinterpret_cast<unsigned char *>(&copy[0]), copy.size()) == (int)copy.size())
            return 0;
        usleep(50000);
    }
    fprintf(stderr, "a block was not sent\n");
    return 1;
}

int main(int argc, char **argv)
{
    if (argc < 5)
        return 2;
    rl3964R partner(strcmp(argv[2], "high") == 0 ? rl3964R::highPriority : rl3964R::lowPriority);
    partner.setReadCallback(take);
    if (partner.open(argv[1], B38400) < 0) {
        perror(argv[1]);
        return 3;
    }
    printf("ready\n");
    fflush(stdout);
    int result = 0;
    if (strcmp(argv[3], "echo") == 0) {
        for (int left = atoi(argv[4]); left > 0 && result == 0; left--)
            result = send(partner, next());
    } else {
        for (int index = 4; index < argc && result == 0; index++) {
            std::string block;
            for (const char *digits = argv[index]; digits[0] && digits[1]; digits += 2)
                block.push_back((char)strtol(std::string(digits, 2).c_str(), nullptr, 16));
            result = send(partner, block);
            if (result == 0)
                next();
        }
    }
    // The thread of the library does not end by itself.
    fflush(stdout);
    _exit(result);
}
