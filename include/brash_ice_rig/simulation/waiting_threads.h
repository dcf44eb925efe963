#pragma once

namespace brash_ice_rig {

/// Makes OpenMP threads that wait for others look out for them for a tenth of a millisecond and then sleep, unless
/// OMP_WAIT_POLICY or GOMP_SPINCOUNT already says something. Call first thing in main().
///
/// Who always sleeps takes long to wake up: a step has three barriers and takes less than a millisecond. Who never
/// sleeps slows a run down several times as soon as another program wants a core. The OpenMP runtime takes its orders
/// from the environment only, and before main(): so this starts the program once more, in the same process. If that
/// fails, it returns and the program goes on as it is.
/// @param arguments  argv of main()
void letWaitingThreadsSleep(char** arguments);

}  // namespace brash_ice_rig
