// See program.hpp.
#include "program.hpp"

namespace strucpp {

LocatedVar locatedVars[6] = {
    { LocatedArea::Memory, LocatedSize::Word, 3, 200000, {0, 0, 0}, nullptr },  // CONTROL AT %MW3.200000
    { LocatedArea::Memory, LocatedSize::Word, 3, 200002, {0, 0, 0}, nullptr },  // STATUS AT %MW3.200002
    { LocatedArea::Memory, LocatedSize::Byte, 1003, 200013, {0, 0, 0}, nullptr },  // SPELLED AT %MB1003.200013
    { LocatedArea::Memory, LocatedSize::Byte, 10000001, 0, {0, 0, 0}, nullptr },  // COUNT AT %MB10000001
    { LocatedArea::Memory, LocatedSize::Byte, 10000002, 0, {0, 0, 0}, nullptr },  // KEPT_SEEN AT %MB10000002
    { LocatedArea::Memory, LocatedSize::Bit, 100, 3, {0, 0, 0}, nullptr }  // BIT AT %MX100.3
};

Configuration_CONFIG0::Configuration_CONFIG0()
{
    task_programs_storage[0] = &INSTANCE1;
    tasks_storage[0] = TaskInstance{"SCAN", 2000000LL, 0, &task_programs_storage[0], 1};
    resources_storage[0] = ResourceInstance{"RES0", "PLC", &tasks_storage[0], 1};
    locatedVars[0].pointer = CONTROL.value.raw_ptr();
    locatedVars[1].pointer = STATUS.value.raw_ptr();
    locatedVars[2].pointer = SPELLED.value.raw_ptr();
    locatedVars[3].pointer = COUNT.value.raw_ptr();
    locatedVars[4].pointer = KEPT_SEEN.value.raw_ptr();
    locatedVars[5].pointer = BIT.value.raw_ptr();
}

void Program_MAIN::run()
{
    if (STATUS.read() == 0x0001) {
        CONTROL.write(0x0001);
    }
    KEPT.set(KEPT + 1);
    PLAIN.write(PLAIN.read() + 1);
    COUNT.write(PLAIN.read());
    KEPT_SEEN.with_lock([this](IEC_BYTE *seen) { seen->set(static_cast<uint8_t>(KEPT.get())); });
    BIT.write(true);
    SPELLED.write(0xFE);
}

const RetainVarInfo Program_MAIN::__retain_vars[] = {
    {"KEPT", offsetof(Program_MAIN, KEPT), sizeof(IEC_INT)},
};

} // namespace strucpp
