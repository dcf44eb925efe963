#include "brash_ice_rig/output/output_file.h"

#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <locale>
#include <sstream>
#include <system_error>
#include <utility>

#include "brash_ice_rig/config/config_error.h"
#include "brash_ice_rig/config/input_file.h"

namespace brash_ice_rig {
namespace {

std::string reasonOf(int error) {
  return error != 0 ? std::generic_category().message(error) : "write failed";
}

}  // namespace

OutputError::OutputError(const std::string& path, const std::string& reason)
    : std::runtime_error(path + ": " + reason), path_(path) {}

void makeDirectory(const std::string& path) {
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (error) throw OutputError(path, error.message());
  if (!std::filesystem::is_directory(path, error)) throw OutputError(path, "is not a directory");
}

void replaceFile(const std::string& path, const std::string& text) {
  OutputFile file(path, OutputFile::Mode::kReplace);
  file.write(text);
  file.close();
}

std::string textOfFile(const std::string& path) {
  try {
    return InputFile(path).read();
  } catch (const ConfigError& error) {
    throw OutputError(path, error.rule());
  }
}

std::string textOfFileIfThere(const std::string& path) {
  try {
    return textOfFile(path);
  } catch (const OutputError&) {
    return "";
  }
}

void removeFile(const std::string& path) {
  std::error_code error;
  std::filesystem::remove(path, error);
  if (error) throw OutputError(path, error.message());
}

std::string toText(double value) {
  if (std::isnan(value)) return "nan";
  if (std::isinf(value)) return value > 0.0 ? "inf" : "-inf";
#ifdef __cpp_lib_to_chars
  char text[32];
  const auto result = std::to_chars(text, text + sizeof text, value);
  return std::string(text, result.ptr);
#else
  // The standard library of gcc 9 lacks to_chars for double.
  const auto format = [value](int precision) {
    std::ostringstream stream;
    stream.imbue(std::locale::classic());
    stream.precision(precision);
    stream << value;
    return stream.str();
  };
  const std::string text = format(std::numeric_limits<double>::digits10);
  std::istringstream back(text);
  back.imbue(std::locale::classic());
  double read = 0.0;
  back >> read;
  return read == value ? text : format(std::numeric_limits<double>::max_digits10);
#endif
}

OutputFile::OutputFile(std::string path, Mode mode)
    : path_(std::move(path)), written_path_(mode == Mode::kReplace ? path_ + ".partial" : path_) {
  errno = 0;
  stream_.open(written_path_, std::ios::binary | std::ios::trunc);
  if (!stream_) fail();
}

OutputFile::~OutputFile() {
  if (closed_ || written_path_ == path_) return;
  stream_.close();
  std::remove(written_path_.c_str());
}

void OutputFile::write(const std::string& text) {
  errno = 0;
  if (!stream_.write(text.data(), static_cast<std::streamsize>(text.size()))) fail();
}

void OutputFile::flush() {
  errno = 0;
  if (!stream_.flush()) fail();
}

void OutputFile::close() {
  errno = 0;
  stream_.close();
  if (!stream_) fail();
  if (written_path_ != path_ && std::rename(written_path_.c_str(), path_.c_str()) != 0) fail();
  closed_ = true;
}

void OutputFile::fail() const {
  throw OutputError(path_, reasonOf(errno));
}

}  // namespace brash_ice_rig
