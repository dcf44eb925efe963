#pragma once

namespace brash_ice_rig {

/// Makes OpenMP threads that wait for others sleep instead of spin, unless OMP_WAIT_POLICY already says something. Call
/// first thing in main().
///
/// Spinning slows a run down several times as soon as another program wants a core. The OpenMP runtime takes the policy
/// from the environment only, and before main(): so this starts the program once more, in the same process. If that
/// fails, it returns and the program goes on as it is.
/// @param arguments  argv of main()
void letWaitingThreadsSleep(char** arguments);

}  // namespace brash_ice_rig
