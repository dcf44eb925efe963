#pragma once

#include <cmath>
#include <fstream>
#include <stdexcept>
#include <string>

namespace brash_ice_rig {

/// A file or directory could not be written, or one of our own not be read back. what() reads `path: reason`.
class OutputError : public std::runtime_error {
 public:
  OutputError(const std::string& path, const std::string& reason);
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

/// Creates a directory with its parents; one that exists is fine.
/// @throws OutputError
void makeDirectory(const std::string& path);

/// Replaces a file as a whole: it is the old one or the new one at every moment. @throws OutputError
void replaceFile(const std::string& path, const std::string& text);

/// All of a file. @throws OutputError
std::string textOfFile(const std::string& path);

/// The same; empty where there is none or it cannot be read.
std::string textOfFileIfThere(const std::string& path);

/// Removes a file; one that is not there is fine. @throws OutputError
void removeFile(const std::string& path);

/// The shortest decimal text that reads back to the same bits, whatever the locale: "nan", "inf" and "-inf" too.
std::string toText(double value);

/// The first multiple of an interval after a time: when what is written at fixed intervals is due next.
inline double nextMultiple(double interval, double time) {
  return interval * (std::floor(time / interval) + 1.0);
}

/// A text file that reports every failure, also those that show only when buffers reach the disk.
class OutputFile {
 public:
  enum class Mode {
    kDirect,   ///< grows in place, for readers that follow it
    kReplace,  ///< appears under its name, complete, at close(); before that an older file of that name stays
  };

  /// @throws OutputError if the file cannot be created
  OutputFile(std::string path, Mode mode);
  /// Without a close() a kReplace file is dropped.
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  /// @throws OutputError
  void write(const std::string& text);
  /// Hands buffered text to the system. @throws OutputError, e.g. when the disk is full
  void flush();
  /// @throws OutputError
  void close();

  const std::string& path() const { return path_; }

 private:
  [[noreturn]] void fail() const;

  std::string path_;
  std::string written_path_;
  std::ofstream stream_;
  bool closed_ = false;
};

}  // namespace brash_ice_rig
