#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "brash_ice_rig/config/scenario.h"
#include "brash_ice_rig/identify/observation.h"
#include "brash_ice_rig/study/run_pool.h"

namespace brash_ice_rig {

/// Simulations that have been stopped by the user before they were done.
struct Interrupted {};

/// Runs of `brash_ice`, each made once and kept: a directory per scenario, named by the hash of its content. Shared by
/// all records whose hoist went the same way, and by all processes that use the directory at the same time.
class RunLibrary {
 public:
  /// @param directory  of the runs; made if missing
  /// @param pool       how runs are made; its callbacks are replaced
  /// @throws OutputError
  RunLibrary(const std::string& directory, const RunPoolOptions& pool);

  /// Keeps a way of the hoist for procedure.motion_file. @return its path
  std::string motionFile(const HoistPath& path);

  /// Puts a scenario on the list of what makeMissing() makes, unless it is there.
  /// @return its key for force()
  std::string request(const Scenario& scenario);

  /// Makes what has been requested and is not there yet; tells on stderr how far it is.
  /// @param what  for the progress line
  /// @throws Interrupted after a stop; the same program goes on where it was
  /// @throws OutputError if a run failed otherwise than by a world that froze: its disk is full, somebody killed it
  void makeMissing(const std::string& what);

  /// The world froze in this run: such parameters cannot be simulated.
  bool failed(const std::string& key) const { return failed_.count(key) > 0; }

  /// @param key  of request(), made and not failed
  const SimulatedForce& force(const std::string& key);

  std::size_t requested() const { return rest_s_.size(); }
  std::size_t made() const { return made_; }

 private:
  std::string directory_;
  RunPoolOptions pool_;
  std::map<std::string, double> rest_s_;  ///< before time 0, of each key that was requested
  std::vector<RunJob> waiting_;
  std::vector<std::string> waiting_keys_;
  std::map<std::string, SimulatedForce> forces_;
  std::map<std::string, std::string> failed_;
  std::size_t made_ = 0;
};

}  // namespace brash_ice_rig
