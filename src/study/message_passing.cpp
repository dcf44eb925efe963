#include "brash_ice_rig/study/message_passing.h"

#include <algorithm>
#include <cstdlib>
#include <stdexcept>

#ifdef BRASH_ICE_HAVE_MPI
#include <mpi.h>
#endif

namespace brash_ice_rig {
namespace {

/// A variable's whole number; 0 where it is not set or something else.
int numberFrom(const char* variable) {
  const char* text = std::getenv(variable);
  return text == nullptr ? 0 : static_cast<int>(std::strtol(text, nullptr, 10));
}

/// Processes that mpirun (Open MPI; MPICH and its kin) or Slurm's srun has started, by the variables they set.
int processCount() {
  int count = std::max({1, numberFrom("OMPI_COMM_WORLD_SIZE"), numberFrom("PMI_SIZE")});
  // Slurm sets the second always, the first only for programs with MPI.
  if (std::getenv("PMIX_RANK") != nullptr) count = std::max(count, numberFrom("SLURM_STEP_NUM_TASKS"));
  return count;
}

}  // namespace

#ifdef BRASH_ICE_HAVE_MPI

MessagePassing::MessagePassing() {
  if (processCount() < 2) return;
  if (MPI_Init(nullptr, nullptr) != MPI_SUCCESS) throw std::runtime_error("MPI does not start");
  started_ = true;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank_);
  MPI_Comm_size(MPI_COMM_WORLD, &size_);
  // Each process would take itself for the only one.
  if (size_ < 2) throw std::runtime_error("mpirun belongs to another MPI than the one this program was built with");
}

void MessagePassing::send(int to, const std::string& text) {
  MPI_Send(text.data(), static_cast<int>(text.size()), MPI_CHAR, to, 0, MPI_COMM_WORLD);
}

// NOLINTNEXTLINE(readability-make-member-function-const): it takes the message away
std::optional<MessagePassing::Message> MessagePassing::receive() {
  if (!started_) return std::nullopt;
  int there = 0, size = 0;
  MPI_Status status;
  MPI_Iprobe(MPI_ANY_SOURCE, 0, MPI_COMM_WORLD, &there, &status);
  if (there == 0) return std::nullopt;
  MPI_Get_count(&status, MPI_CHAR, &size);
  Message message;
  message.from = status.MPI_SOURCE;
  message.text.resize(static_cast<std::size_t>(size));
  MPI_Recv(message.text.data(), size, MPI_CHAR, message.from, 0, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
  return message;
}

void MessagePassing::finish() {
  if (!started_) return;
  for (int other = 1; rank_ == 0 && other < size_; ++other) send(other, kStop);
  started_ = false;
  MPI_Finalize();
}

#else

MessagePassing::MessagePassing() {
  if (processCount() < 2) return;
  throw std::runtime_error(
      "mpirun has started several processes, but this program was built without MPI: install libopenmpi-dev and build "
      "again, or start it without mpirun");
}

void MessagePassing::send(int, const std::string&) {}

std::optional<MessagePassing::Message> MessagePassing::receive() {
  return std::nullopt;
}

void MessagePassing::finish() {}

#endif

MessagePassing::~MessagePassing() {
  finish();
}

}  // namespace brash_ice_rig
