#pragma once

namespace brash_ice_rig {

/// The processes that mpirun (Open MPI; MPICH and its kin) or Slurm's srun has started together, by the variables that
/// they set. Nothing passes between them.
struct LaunchedTogether {
  int rank = 0;
  int size = 1;
};

/// @return rank 0 of 1 for a process that was started by hand
LaunchedTogether launchedTogether();

}  // namespace brash_ice_rig
