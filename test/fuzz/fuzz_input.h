#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <system_error>
#include <vector>

#include <unistd.h>

namespace brash_ice_rig {

/// Ends the program where a promise is broken that no sanitizer sees; libFuzzer then keeps the input.
inline void require(bool holds, const char* promise) {
  if (holds) return;
  std::fprintf(stderr, "broken promise: %s\n", promise);
  std::abort();
}

inline std::string textOf(const std::uint8_t* data, std::size_t size) {
  return {reinterpret_cast<const char*>(data), size};
}

/// Line between the files of an input that stands for several.
constexpr char kNextFile[] = "\n=====\n";

/// The files of an input, exactly as many as asked for: empty ones at the end, the rest in the last.
inline std::vector<std::string> filesOf(const std::string& input, std::size_t count) {
  std::vector<std::string> files;
  std::size_t from = 0;
  while (files.size() + 1 < count) {
    const std::size_t end = input.find(kNextFile, from);
    if (end == std::string::npos) break;
    files.push_back(input.substr(from, end + 1 - from));
    from = end + sizeof kNextFile - 1;
  }
  files.push_back(input.substr(from));
  files.resize(count);
  return files;
}

/// A directory for files that readers take by their path. scripts/fuzz puts it into memory.
class FuzzDirectory {
 public:
  FuzzDirectory() { std::filesystem::create_directories(path_); }
  ~FuzzDirectory() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  FuzzDirectory(const FuzzDirectory&) = delete;
  FuzzDirectory& operator=(const FuzzDirectory&) = delete;

  std::string file(const std::string& name) const { return (path_ / name).string(); }
  std::string write(const std::string& name, const std::string& content) const {
    std::string path = file(name);
    std::ofstream(path, std::ios::binary | std::ios::trunc)
        .write(content.data(), static_cast<std::streamsize>(content.size()));
    return path;
  }

 private:
  std::filesystem::path path_ = std::filesystem::temp_directory_path() / ("brash_ice_fuzz_" + std::to_string(getpid()));
};

}  // namespace brash_ice_rig
