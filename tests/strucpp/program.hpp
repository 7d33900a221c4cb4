// A program in the form that STruC++ generates, written for the tests. In Structured Text:
//
//   PROGRAM MAIN
//     VAR_EXTERNAL CONTROL, STATUS : WORD; SPELLED, COUNT, KEPT_SEEN : BYTE; BIT : BOOL; PLAIN : INT; END_VAR
//     VAR RETAIN KEPT : INT := 3; END_VAR
//     IF STATUS = 16#0001 THEN CONTROL := 16#0001; END_IF;
//     KEPT := KEPT + 1; PLAIN := PLAIN + 1;
//     COUNT := INT_TO_BYTE(PLAIN); KEPT_SEEN := INT_TO_BYTE(KEPT);
//     BIT := TRUE; SPELLED := 16#FE;
//   END_PROGRAM
#pragma once
#include "iec_var.hpp"
#include "iec_global.hpp"
#include "iec_located.hpp"
#include "iec_std_lib.hpp"
#include "iec_retain.hpp"

namespace strucpp {

inline GlobalVar<IEC_WORD> CONTROL{0};
inline GlobalVar<IEC_WORD> STATUS{0};
inline GlobalVar<IEC_BYTE> SPELLED{0};
inline GlobalVar<IEC_BYTE> COUNT{0};
inline GlobalVar<IEC_BYTE> KEPT_SEEN{7};
inline GlobalVar<IEC_BOOL> BIT{false};
inline GlobalVar<IEC_INT> PLAIN{5};

class Program_MAIN : public ProgramBase {
  public:
    IEC_INT KEPT;
    Program_MAIN() : KEPT(3) {}
    void run() override;
    static const RetainVarInfo __retain_vars[1];
    const RetainVarInfo *getRetainVars() const override { return __retain_vars; }
    size_t getRetainCount() const override { return 1; }
};

class Configuration_CONFIG0 : public ConfigurationInstance {
  public:
    Program_MAIN INSTANCE1;
    TaskInstance tasks_storage[1];
    ProgramBase *task_programs_storage[1];
    ResourceInstance resources_storage[1];
    Configuration_CONFIG0();
    const char *get_name() const override { return "CONFIG0"; }
    ResourceInstance *get_resources() override { return resources_storage; }
    size_t get_resource_count() const override { return 1; }
};

extern LocatedVar locatedVars[6];

} // namespace strucpp
