#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace brash_ice_rig {

// What a file may have. The bounds are there for files that are no records: reading ends at the first one passed.

/// Lines, comments included: 2.7 h at 100 Hz.
constexpr std::size_t kMaxCsvLines = 1000000;
/// Bytes in a line.
constexpr std::size_t kMaxCsvLineLength = 10000;

/// Numbers from a CSV file.
struct CsvTable {
  /// A cell that should hold a number and does not.
  struct BadCell {
    std::size_t row;
    std::string column, text;
  };

  std::vector<std::string> header;                          ///< names in the order of the file
  std::vector<std::optional<std::vector<double>>> columns;  ///< in the order asked for; empty: the file lacks it
  std::vector<std::size_t> line;                            ///< of each row in the file, from 1
  std::optional<BadCell> first_bad_cell;
  std::size_t bad_cells = 0;
  bool last_row_cut_off = false;  ///< the last line had too few cells and was left out
};

/// Reads some columns of a CSV file after RFC 4180: a header line, commas, quotes around cells if wanted, line ends LF
/// or CRLF. Beyond it, lines that start with # and empty lines are skipped, and blanks around a cell do not count. A
/// line break within quotes is refused. A cell becomes a number with a decimal point, whatever the locale; `nan` and
/// `inf` in C's spellings are taken as such; an empty cell and any other text are NaN, the latter counted as a bad
/// cell.
/// @param wanted  names of columns, found by the header in any order
/// @throws ConfigError naming file and line: not readable, not a regular file, not text, a line or the file too long,
/// no
///   header, a name twice in it, another delimiter, no rows, a row with a wrong number of cells
CsvTable readCsv(const std::string& path, const std::vector<std::string>& wanted);

/// Whether the first line that is neither empty nor a comment is a header with one of some names. False if the file
/// cannot be read.
bool csvHasColumn(const std::string& path, const std::vector<std::string>& names);

}  // namespace brash_ice_rig
