// Stub of STruC++'s header of this name: programs, tasks and the configuration.
#pragma once
#include <cstddef>
#include <cstdint>
namespace strucpp {
struct RetainVarInfo;
struct ProgramBase {
    virtual ~ProgramBase() = default;
    virtual void run() = 0;
    virtual const RetainVarInfo *getRetainVars() const { return nullptr; }
    virtual size_t getRetainCount() const { return 0; }
};
struct TaskInstance {
    const char *name;
    int64_t interval_ns;
    int32_t priority;
    ProgramBase **programs;
    size_t program_count;
};
struct ResourceInstance {
    const char *name;
    const char *processor;
    TaskInstance *tasks;
    size_t task_count;
};
struct ConfigurationInstance {
    virtual ~ConfigurationInstance() = default;
    virtual const char *get_name() const = 0;
    virtual ResourceInstance *get_resources() = 0;
    virtual size_t get_resource_count() const = 0;
};
inline int64_t __CURRENT_TIME_NS = 0;
} // namespace strucpp
