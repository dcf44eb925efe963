#pragma once

#include <optional>
#include <string>

namespace brash_ice_rig {

/// Text messages between the processes that mpirun has started, over MPI. A process on its own has rank 0 of 1, and MPI
/// is not started at all.
class MessagePassing {
 public:
  struct Message {
    int from = 0;
    std::string text;
  };

  /// Text that finish() sends.
  static constexpr const char* kStop = "stop";

  /// @throws std::runtime_error under mpirun if this program was built without MPI
  MessagePassing();
  ~MessagePassing();
  MessagePassing(const MessagePassing&) = delete;
  MessagePassing& operator=(const MessagePassing&) = delete;

  int rank() const { return rank_; }
  int size() const { return size_; }

  /// May wait until the other side receives.
  void send(int to, const std::string& text);

  /// The oldest message, without waiting for one.
  std::optional<Message> receive();

  /// Rank 0 tells the others to stop; MPI ends when all have called this. No messages after it; a second call does
  /// nothing.
  void finish();

 private:
  int rank_ = 0, size_ = 1;
  [[maybe_unused]] bool started_ = false;  ///< never without MPI
};

}  // namespace brash_ice_rig
