#include <time.h>

#include <numeric>
#include <vector>

#define COMMRAM_STRUCPP_MAIN
#include "commram_strucpp.h"
#include "iec_retain.hpp"
#include "program.hpp"

COMMRAM_MATIEC_STORAGE

static struct timespec __CURRENT_TIME;
static unsigned long long common_ticktime__ = 1000000;

/* The program's configuration; its constructor gives all variables of programs their initial values. */
static strucpp::Configuration_CONFIG0 *configuration()
{
    alignas(strucpp::Configuration_CONFIG0) static unsigned char place[sizeof(strucpp::Configuration_CONFIG0)];
    static strucpp::Configuration_CONFIG0 *const first = new (place) strucpp::Configuration_CONFIG0();
    return first;
}

template <typename F> static void each_task(F use)
{
    strucpp::ResourceInstance *resources = configuration()->get_resources();
    for (size_t i = 0; i < configuration()->get_resource_count(); i++) {
        for (size_t j = 0; j < resources[i].task_count; j++)
            use(resources[i].tasks[j]);
    }
}

/* The variables that are declared RETAIN in programs. */
static std::vector<std::pair<unsigned char *, size_t>> retained()
{
    std::vector<std::pair<unsigned char *, size_t>> all;
    each_task([&all](strucpp::TaskInstance &task) {
        for (size_t i = 0; i < task.program_count; i++) {
            strucpp::ProgramBase *program = task.programs[i];
            const strucpp::RetainVarInfo *variables = program->getRetainVars();
            for (size_t j = 0; j < program->getRetainCount(); j++)
                all.emplace_back(reinterpret_cast<unsigned char *>(program) + variables[j].offset, variables[j].size);
        }
    });
    return all;
}

/* Initial values for all variables; not for those that are retained if commram_matiec_keeps_retain. */
static void config_init__(void)
{
    std::vector<std::vector<unsigned char>> kept;
    if (commram_matiec_keeps_retain) {
        for (const auto &[at, bytes] : retained())
            kept.emplace_back(at, at + bytes);
    }
    for (strucpp::commram_global *global = strucpp::commram_global::first; global; global = global->next)
        global->begin();
    configuration()->~Configuration_CONFIG0();
    new (configuration()) strucpp::Configuration_CONFIG0();
    for (size_t i = 0; i < kept.size(); i++)
        memcpy(retained()[i].first, kept[i].data(), kept[i].size());
    if (!commram_strucpp_bind(strucpp::locatedVars))
        exit(2);
    for (strucpp::commram_global *global = strucpp::commram_global::first; global; global = global->next) {
        if (global->at)
            global->give_initial_value();
    }
    common_ticktime__ = 0;
    each_task([](strucpp::TaskInstance &task) {
        common_ticktime__ = std::gcd(common_ticktime__, static_cast<unsigned long long>(task.interval_ns));
    });
    common_ticktime__ = common_ticktime__ ? common_ticktime__ : 1000000;
}

/* Runs the programs of all tasks that are due; those of a task without an interval each time. */
static void config_run__(unsigned long tick)
{
    strucpp::__CURRENT_TIME_NS = __CURRENT_TIME.tv_sec * INT64_C(1000000000) + __CURRENT_TIME.tv_nsec;
    each_task([tick](strucpp::TaskInstance &task) {
        if (task.interval_ns && tick * common_ticktime__ % static_cast<unsigned long long>(task.interval_ns))
            return;
        for (size_t i = 0; i < task.program_count; i++)
            task.programs[i]->run();
    });
}

