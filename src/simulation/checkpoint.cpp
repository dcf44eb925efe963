#include "brash_ice_rig/simulation/checkpoint.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cassert>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <system_error>
#include <utility>

#include "brash_ice_rig/config/input_file.h"
#include "brash_ice_rig/config/scenario_reader.h"
#include "brash_ice_rig/config/yaml_document.h"
#include "brash_ice_rig/output/output_file.h"
#include "brash_ice_rig/system/descriptor.h"
#include "brash_ice_rig/system/hash.h"

namespace brash_ice_rig {
namespace {

// Like PNG's: a transfer as text, which changes line ends or clears the highest bit, destroys it.
constexpr char kMagic[8] = {'\x89', 'B', 'R', 'I', 'C', '\r', '\n', '\x1a'};
constexpr std::uint32_t kByteOrder = 0x01020304u, kOtherByteOrder = 0x04030201u;
/// Goes up with each change of the format, and of what follows from a state: the load cell's noise of format 1 would go
/// on otherwise. What a section holds tells itself, by the names of its fields.
constexpr std::uint32_t kFormatVersion = 2;

struct Header {
  char magic[sizeof kMagic];
  std::uint32_t byte_order;
  std::uint32_t version;
  std::uint64_t file_size;
};
static_assert(sizeof(Header) == 24, "no padding");

constexpr std::size_t kNameSize = 24;
constexpr std::size_t kSectionHead = kNameSize + sizeof(std::uint64_t);
constexpr std::size_t kMaxSections = 64;
constexpr std::uint64_t kMaxFileSize = std::uint64_t{64} << 30;  // 100 million particles have less
constexpr char kScenarioSection[] = "scenario";

template <class Value>
void append(std::string& text, const Value& value) {
  text.append(reinterpret_cast<const char*>(&value), sizeof value);
}

std::uint64_t hashOf(const std::string& text) {
  Hash hash;
  hash.add(text.data(), text.size());
  return hash.value();
}

/// Appends the fields of a section.
class Saver : public StateVisitor {
 public:
  explicit Saver(std::string& content) : content_(content) {}

 protected:
  std::size_t begin(const char* name, std::size_t count, std::size_t size, Length) override {
    const std::size_t length = std::strlen(name);
    assert(length < 64 && size < 256);
    content_ += static_cast<char>(length);
    content_.append(name, length);
    content_ += static_cast<char>(size);
    append(content_, static_cast<std::uint64_t>(count));
    return count;
  }
  void bytes(void* data, std::size_t count) override {
    if (count > 0) content_.append(static_cast<const char*>(data), count);
  }

 private:
  std::string& content_;
};

/// Reads the fields of a section.
class Loader : public StateVisitor {
 public:
  Loader(const CheckpointReader& file, std::ifstream& stream, std::string section, std::uint64_t size)
      : file_(file), stream_(stream), section_(std::move(section)), left_(size) {}

  bool loading() const override { return true; }
  [[noreturn]] void refuse(const std::string& reason) const override {
    file_.refuse("section " + section_ + ": " + reason);
  }
  bool atEnd() const { return left_ == 0; }

 protected:
  std::size_t begin(const char* name, std::size_t count, std::size_t size, Length length) override {
    const std::string wanted = name;
    const std::size_t name_length = get<unsigned char>();
    std::string found(name_length, '\0');  // at most 255 bytes
    take(found.data(), found.size());
    if (found != wanted) refuse("was written by a program that keeps other things: there is no " + wanted);
    const std::size_t found_size = get<unsigned char>();
    const auto found_count = get<std::uint64_t>();
    const bool fits = found_size == size && found_count <= left_ / size;
    const bool wanted_count = length == Length::kAny || found_count == count;
    if (!fits || !wanted_count) {
      refuse(wanted + " has " + std::to_string(found_count) + " values of " + std::to_string(found_size) +
             " bytes, not " + std::to_string(count) + " of " + std::to_string(size));
    }
    return static_cast<std::size_t>(found_count);
  }
  void bytes(void* data, std::size_t count) override { take(data, count); }

 private:
  template <class Value>
  Value get() {
    Value value{};
    take(&value, sizeof value);
    return value;
  }
  void take(void* data, std::size_t count) {
    if (count > left_) refuse("ends too early");
    if (count > 0 && !stream_.read(static_cast<char*>(data), static_cast<std::streamsize>(count))) {
      file_.refuse("cannot be read any further");
    }
    left_ -= count;
  }

  const CheckpointReader& file_;
  std::ifstream& stream_;
  std::string section_;
  std::uint64_t left_;
};

bool writeAll(int descriptor, const std::string& content) {
  for (std::size_t done = 0; done < content.size();) {
    const ssize_t written = write(descriptor, content.data() + done, content.size() - done);
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return false;
    done += static_cast<std::size_t>(written);
  }
  return true;
}

}  // namespace

CheckpointWriter::CheckpointWriter(std::string path, const Scenario& scenario) : path_(std::move(path)) {
  append(content_, Header{});  // filled in at the end
  add(kScenarioSection, [&](StateVisitor& visitor) {
    std::string yaml = toYaml(scenario);
    visitor("yaml", yaml);
  });
}

void CheckpointWriter::add(const std::string& name, const std::function<void(StateVisitor&)>& visit) {
  assert(!name.empty() && name.size() <= kNameSize);
  content_.append(name).append(kNameSize - name.size(), '\0');
  const std::size_t place_of_size = content_.size();
  append(content_, std::uint64_t{0});
  Saver saver(content_);
  visit(saver);
  const std::uint64_t size = content_.size() - place_of_size - sizeof(std::uint64_t);
  std::memcpy(&content_[place_of_size], &size, sizeof size);
}

void CheckpointWriter::commit() {
  Header header{};
  std::memcpy(header.magic, kMagic, sizeof kMagic);
  header.byte_order = kByteOrder;
  header.version = kFormatVersion;
  header.file_size = content_.size() + sizeof(std::uint64_t);
  std::memcpy(content_.data(), &header, sizeof header);
  append(content_, hashOf(content_));

  const std::string partial = path_ + ".partial";
  const auto fail = [&] {
    const int reason = errno;
    unlink(partial.c_str());
    throw OutputError(path_, std::generic_category().message(reason));
  };
  Descriptor file(partial, O_WRONLY | O_CREAT | O_TRUNC | O_NOFOLLOW);
  if (!file.good()) throw OutputError(path_, std::generic_category().message(errno));
  if (!writeAll(file.number(), content_) || fsync(file.number()) != 0 || !file.close()) fail();
  if (rename(partial.c_str(), path_.c_str()) != 0) fail();
  // The name, too, has to reach the disk. Some file systems cannot do that for a directory: then it is up to them.
  const std::filesystem::path directory = std::filesystem::path(path_).parent_path();
  const Descriptor holder(directory.empty() ? "." : directory.string(), O_RDONLY | O_DIRECTORY);
  if (holder.good()) fsync(holder.number());
}

CheckpointReader::CheckpointReader(const std::string& path) : path_(path) {
  // What is looked at is what is read: a name could lead elsewhere a moment later. Opened so that a pipe does not keep
  // us waiting; a device has no end.
  const Descriptor file(path, O_RDONLY | O_NONBLOCK | O_NOCTTY);
  if (!file.good()) refuse(std::string("file cannot be read: ") + std::strerror(errno));
  struct stat status {};
  if (fstat(file.number(), &status) != 0 || !S_ISREG(status.st_mode)) refuse("is not a file");
  stream_.open("/proc/self/fd/" + std::to_string(file.number()), std::ios::binary);
  if (!stream_) refuse(std::string("file cannot be read: ") + std::strerror(errno));
  stream_.seekg(0, std::ios::end);
  const auto size = static_cast<std::uint64_t>(std::max<std::streamoff>(stream_.tellg(), 0));
  stream_.seekg(0);

  Header header{};
  if (size < sizeof header + sizeof(std::uint64_t) || !stream_.read(reinterpret_cast<char*>(&header), sizeof header) ||
      std::memcmp(header.magic, kMagic, sizeof kMagic) != 0) {
    refuse("is not a checkpoint of brash_ice_rig, or one that was cut off at its beginning");
  }
  if (header.byte_order == kOtherByteOrder) refuse("was written on a machine of the other byte order");
  if (header.byte_order != kByteOrder) refuse("is damaged: there is no mark of the byte order");
  if (header.version != kFormatVersion) {
    refuse("has format version " + std::to_string(header.version) + ", but this program reads " +
           std::to_string(kFormatVersion) + " only");
  }
  if (size > kMaxFileSize) refuse("is larger than 64 GB, which no checkpoint of ours is");
  if (header.file_size != size) {
    refuse("is damaged: it has " + std::to_string(size) + " bytes, but had " + std::to_string(header.file_size) +
           " when it was written");
  }

  Hash hash;
  hash.add(&header, sizeof header);
  const std::uint64_t end = size - sizeof(std::uint64_t);
  std::vector<char> chunk(std::min<std::uint64_t>(end, 1u << 20));  // whole words, see Hash
  for (std::uint64_t done = sizeof header; done < end;) {
    const std::uint64_t wanted = std::min<std::uint64_t>(end - done, chunk.size() / 8 * 8);
    if (!stream_.read(chunk.data(), static_cast<std::streamsize>(wanted))) refuse("cannot be read any further");
    hash.add(chunk.data(), wanted);
    done += wanted;
  }
  std::uint64_t written_hash = 0;
  if (!stream_.read(reinterpret_cast<char*>(&written_hash), sizeof written_hash)) refuse("cannot be read any further");
  if (written_hash != hash.value()) refuse("is damaged: its checksum is wrong");

  listSections(end);
  if (size_t{kMaxYamlBytes} < this->size(kScenarioSection)) refuse("is damaged: its scenario is too large");
  read(kScenarioSection, [this](StateVisitor& visitor) {
    std::string yaml;
    visitor("yaml", yaml);
    scenario_ = parseScenario(yaml, path_ + ": scenario");
  });
}

void CheckpointReader::listSections(std::uint64_t end) {
  for (std::uint64_t at = sizeof(Header); at < end;) {
    char name[kNameSize];
    std::uint64_t size = 0;
    if (end - at < kSectionHead) refuse("is damaged: a section begins too close to the end");
    stream_.seekg(static_cast<std::streamoff>(at));
    stream_.read(name, sizeof name);
    stream_.read(reinterpret_cast<char*>(&size), sizeof size);
    if (!stream_) refuse("cannot be read any further");
    at += kSectionHead;
    if (size > end - at) refuse("is damaged: a section is longer than the file");
    if (sections_.size() == kMaxSections) refuse("is damaged: it has too many sections");
    sections_.push_back({std::string(name, strnlen(name, sizeof name)), at, size});
    at += size;
  }
}

const CheckpointReader::Section* CheckpointReader::find(const std::string& name) const {
  const auto found =
      std::find_if(sections_.begin(), sections_.end(), [&](const Section& section) { return section.name == name; });
  return found == sections_.end() ? nullptr : &*found;
}

std::uint64_t CheckpointReader::size(const std::string& section) const {
  const Section* found = find(section);
  return found == nullptr ? 0 : found->size;
}

void CheckpointReader::read(const std::string& section, const std::function<void(StateVisitor&)>& visit) {
  const Section* found = find(section);
  if (found == nullptr) refuse("has no section " + section);
  stream_.clear();
  stream_.seekg(static_cast<std::streamoff>(found->begin));
  Loader loader(*this, stream_, section, found->size);
  visit(loader);
  if (!loader.atEnd()) loader.refuse("was written by a program that keeps more");
}

void CheckpointReader::refuse(const std::string& reason) const {
  throw ConfigError("", "", reason, path_);
}

bool isCheckpoint(const std::string& path) {
  return fileBeginsWith(path, std::string(kMagic, sizeof kMagic));
}

}  // namespace brash_ice_rig
