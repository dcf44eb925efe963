#pragma once

#include <string>

#include "../output/temporary_directory.h"

namespace brash_ice_rig {

/// A directory with the scenario of a field so small that a run takes a fraction of a second.
class StudyDirectory : public TemporaryDirectory {
 public:
  StudyDirectory() {
    put("small.yaml",
        "title: Small field\n"
        "field: {length_x_m: 3.0, length_y_m: 3.0, thickness_m: 0.6, jitter_ratio: 0.1}\n"
        "collector: {radius_m: 0.6}\n"
        "procedure: {settle_duration_s: 0.5, lift_duration_s: 1.5}\n"
        "solver: {threads: 2}\n");
  }

  /// Writes a study of that scenario and returns its path.
  std::string putStudy(const std::string& rest, const std::string& name = "study.yaml") const {
    return put(name, "title: Small study\nscenario: small.yaml\n" + rest);
  }
};

}  // namespace brash_ice_rig
