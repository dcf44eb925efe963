// A measured record: CSV, manifest, and the scenario file that the manifest may name as rig.yaml. Whatever can be read
// is checked without an exception and described.

#include "brash_ice_rig/config/config_error.h"
#include "brash_ice_rig/identify/record.h"
#include "brash_ice_rig/identify/record_check.h"
#include "fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace brash_ice_rig;
  static const FuzzDirectory kDirectory;
  const std::vector<std::string> files = filesOf(textOf(data, size), 3);
  const std::string path = kDirectory.write("record.csv", files[0]);
  kDirectory.write("record.yaml", files[1]);
  kDirectory.write("rig.yaml", files[2]);
  Record record;
  try {
    record = readRecord(path);
  } catch (const ConfigError&) {
    return 0;
  }
  const std::size_t rows = record.size();
  require(rows > 0 && record.line.size() == rows && record.force_n.size() == rows &&
              record.hoist_position_m.size() == rows && record.hoist_speed_mps.size() == rows,
          "all samples are of one length");
  const RecordReport report = checkRecord(record);
  for (std::size_t i = 0; i < report.rows.size(); ++i) {
    require(report.rows[i] < rows && (i == 0 || record.time_s[report.rows[i]] > record.time_s[report.rows[i - 1]]),
            "time increases over the rows to work with");
  }
  for (const Finding& finding : report.findings) {
    require(!finding.text.empty() && (!finding.row || *finding.row < rows), "a finding says what and where");
  }
  require(!describe("record", record, report).empty(), "a record can be described");
  return 0;
}
