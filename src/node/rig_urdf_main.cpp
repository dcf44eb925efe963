// rig_urdf: prints the rig's URDF for a scenario. pull_up.launch puts its output on the parameter server, so that the
// description is there before robot_state_publisher and rviz look for it.

#include <cstdio>
#include <exception>

#include "brash_ice_rig/config/scenario_reader.h"
#include "brash_ice_rig/node/rig_urdf.h"
#include "brash_ice_rig/node/split_list.h"

int main(int argc, char** argv) {
  if (argc != 5) {
    std::fprintf(stderr, "usage: rig_urdf SCENARIO OVERLAYS SETTINGS FRAME_PREFIX   (lists: entries with ; between)\n");
    return 2;
  }
  try {
    const brash_ice_rig::ScenarioSources sources{argv[1], brash_ice_rig::splitList(argv[2]),
                                                 brash_ice_rig::splitList(argv[3])};
    std::fputs(brash_ice_rig::makeRigUrdf(brash_ice_rig::loadScenario(sources), argv[4]).c_str(), stdout);
    return std::fflush(stdout) == 0 ? 0 : 1;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
}
