#include "brash_ice_rig/output/output_file.h"

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <locale>
#include <string>

#include <gtest/gtest.h>

#include "temporary_directory.h"

namespace brash_ice_rig {
namespace {

struct CommaDecimal : std::numpunct<char> {
  char do_decimal_point() const override { return ','; }
};

TEST(OutputText, ReadsBackToTheSameBits) {
  for (const double value : {0.1, 1.0 / 3.0, -17890.123456789012, 5.0e-324, std::numeric_limits<double>::max(), -0.0}) {
    const double back = std::strtod(toText(value).c_str(), nullptr);
    EXPECT_EQ(back, value) << toText(value);
    EXPECT_EQ(std::signbit(back), std::signbit(value));
  }
}

TEST(OutputText, DoesNotDependOnTheLocale) {
  const std::locale before = std::locale::global(std::locale(std::locale::classic(), new CommaDecimal));
  const std::string text = toText(0.052);
  std::locale::global(before);
  EXPECT_EQ(text, "0.052");
}

TEST(OutputText, NamesWhatIsNotFinite) {
  EXPECT_EQ(toText(std::nan("")), "nan");
  EXPECT_EQ(toText(-std::numeric_limits<double>::infinity()), "-inf");
}

TEST(OutputFile, ReplacementAppearsOnlyWhenComplete) {
  const TemporaryDirectory directory;
  const std::string path = directory.put("summary.json", "old");
  OutputFile file(path, OutputFile::Mode::kReplace);
  file.write("new");
  file.flush();
  EXPECT_EQ(readFile(path), "old");
  file.close();
  EXPECT_EQ(readFile(path), "new");
}

TEST(OutputFile, UnfinishedReplacementLeavesTheOldFileAndNoOther) {
  const TemporaryDirectory directory;
  const std::string path = directory.put("summary.json", "old");
  { OutputFile(path, OutputFile::Mode::kReplace).write("half"); }
  EXPECT_EQ(readFile(path), "old");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(directory.path()), {}), 1);
}

TEST(OutputFile, FullDiskIsReportedWithPathAndReason) {
  OutputFile file("/dev/full", OutputFile::Mode::kDirect);
  try {
    file.write("x");
    file.flush();
    FAIL() << "a full disk went unnoticed";
  } catch (const OutputError& error) {
    EXPECT_EQ(std::string(error.what()), "/dev/full: No space left on device");
  }
}

TEST(OutputFile, FullDiskIsReportedAtCloseToo) {
  OutputFile file("/dev/full", OutputFile::Mode::kDirect);
  file.write("x");
  EXPECT_THROW(file.close(), OutputError);
}

TEST(OutputFile, DirectoryBelowAFileIsRefusedWithItsPath) {
  const TemporaryDirectory directory;
  const std::string below = directory.put("file", "") + "/out";
  try {
    makeDirectory(below);
    FAIL() << "made a directory below a file";
  } catch (const OutputError& error) {
    EXPECT_EQ(error.path(), below);
  }
  EXPECT_THROW(OutputFile(below, OutputFile::Mode::kDirect), OutputError);
  EXPECT_THROW(makeDirectory(directory.file("file")), OutputError);
}

TEST(OutputFile, ExistingDirectoryIsFine) {
  const TemporaryDirectory directory;
  EXPECT_NO_THROW(makeDirectory(directory.path()));
  EXPECT_NO_THROW(makeDirectory(directory.file("a/b/c")));
  EXPECT_TRUE(std::filesystem::is_directory(directory.file("a/b/c")));
}

}  // namespace
}  // namespace brash_ice_rig
