#include "brash_ice_rig/config/csv.h"

#include <locale.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <cstring>
#include <limits>

#include "brash_ice_rig/config/config_error.h"
#include "brash_ice_rig/config/input_file.h"
#include "brash_ice_rig/config/number_check.h"

namespace brash_ice_rig {
namespace {

constexpr std::size_t kShownLength = 40;  // of the user's text in a message

std::string shown(const std::string& text) {
  return "`" + (text.size() > kShownLength ? text.substr(0, kShownLength) + "..." : text) + "`";
}

/// Lines of a text file, none longer than allowed.
class LineReader {
 public:
  explicit LineReader(const std::string& path) : path_(path), file_(path) {}

  /// The next line that is neither empty nor a comment, without its end. False: there is none.
  bool next(std::string& line) {
    while (nextLine(line)) {
      const auto first = line.find_first_not_of(" \t");
      if (first != std::string::npos && line[first] != '#') return true;
    }
    return false;
  }

  std::size_t number() const { return number_; }
  std::string where() const { return path_ + ":" + std::to_string(number_); }

 private:
  bool nextLine(std::string& line) {
    line.clear();
    if (peek() == kEnd) return false;
    if (++number_ > kMaxCsvLines) {
      throw ConfigError("", "", "more than " + std::to_string(kMaxCsvLines) + " lines; give fewer samples a second",
                        path_);
    }
    for (int c = take(); c != kEnd && c != '\n'; c = take()) {
      if (c == '\r') {
        if (peek() == '\n') take();
        break;
      }
      if (c < ' ' && c != '\t') {
        throw ConfigError("", "", "not text: byte " + std::to_string(c) + "; a record is plain text, UTF-8 or ASCII",
                          where());
      }
      if (line.size() == kMaxCsvLineLength) {
        throw ConfigError("", "", "line longer than " + std::to_string(kMaxCsvLineLength) + " bytes", where());
      }
      line += static_cast<char>(c);
    }
    constexpr const char* kByteOrderMark = "\xEF\xBB\xBF";
    if (number_ == 1 && line.rfind(kByteOrderMark, 0) == 0) line.erase(0, std::strlen(kByteOrderMark));
    return true;
  }

  static constexpr int kEnd = -1;

  /// The next byte, or kEnd.
  int peek() {
    if (next_ == end_) {
      next_ = 0;
      end_ = file_.read(buffer_.data(), buffer_.size());
    }
    return next_ < end_ ? static_cast<unsigned char>(buffer_[next_]) : kEnd;
  }
  int take() {
    const int byte = peek();
    if (byte != kEnd) ++next_;
    return byte;
  }

  std::string path_;
  InputFile file_;
  std::array<char, 1u << 14> buffer_;
  std::size_t next_ = 0, end_ = 0;
  std::size_t number_ = 0;
};

std::string trimmed(const std::string& text) {
  const auto first = text.find_first_not_of(" \t");
  if (first == std::string::npos) return "";
  return text.substr(first, text.find_last_not_of(" \t") - first + 1);
}

/// Cells of a line.
void split(const std::string& line, const std::string& where, std::vector<std::string>& cells) {
  cells.clear();
  std::size_t at = 0;
  while (true) {
    const std::size_t start = line.find_first_not_of(" \t", at);
    if (start != std::string::npos && line[start] == '"') {
      std::string cell;
      at = start + 1;
      while (at < line.size() && (line[at] != '"' || (at + 1 < line.size() && line[at + 1] == '"'))) {
        cell += line[at];
        at += line[at] == '"' ? 2 : 1;
      }
      if (at >= line.size()) throw ConfigError("", "", "a quote is not closed within the line", where);
      const std::size_t comma = std::min(line.find_first_not_of(" \t", at + 1), line.size());
      if (comma < line.size() && line[comma] != ',') {
        throw ConfigError("", "", "text between a closing quote and the next comma", where);
      }
      cells.push_back(std::move(cell));
      at = comma;
    } else {
      const std::size_t comma = std::min(line.find(',', at), line.size());
      cells.push_back(trimmed(line.substr(at, comma - at)));
      at = comma;
    }
    if (at >= line.size()) return;
    ++at;
  }
}

/// The number in a cell; NaN if it is empty.
/// @param bad  true: the cell is neither empty nor a number
double numberIn(const std::string& cell, bool& bad) {
  bad = false;
  if (cell.empty()) return std::numeric_limits<double>::quiet_NaN();
  static const locale_t kClassic = newlocale(LC_ALL_MASK, "C", nullptr);
  // strtod() takes more than we do, hexadecimal numbers for one.
  bad = cell.find_first_not_of("0123456789+-.eE") != std::string::npos && !isNonFiniteWord(cell);
  if (bad) return std::numeric_limits<double>::quiet_NaN();
  char* end = nullptr;
  const double value = strtod_l(cell.c_str(), &end, kClassic);
  bad = end != cell.c_str() + cell.size();
  return bad ? std::numeric_limits<double>::quiet_NaN() : value;
}

void checkHeader(const std::vector<std::string>& header, const std::string& line, const std::string& where) {
  if (header.size() == 1) {
    for (const auto& [delimiter, name] : {std::pair{';', "semicolons"}, std::pair{'\t', "tabs"}}) {
      if (line.find(delimiter) == std::string::npos) continue;
      throw ConfigError(
          "", "", std::string("columns are separated by ") + name + "; a record has commas, and decimal points", where);
    }
  }
  bool bad = false;
  const auto is_number = [&bad](const std::string& cell) { return numberIn(cell, bad), !bad && !cell.empty(); };
  if (std::all_of(header.begin(), header.end(), is_number)) {
    throw ConfigError(
        "", "", "no header: the first line must name the columns, such as time_s,force_n,hoist_position_m", where);
  }
  for (const std::string& name : header) {
    if (name.empty() || std::count(header.begin(), header.end(), name) == 1) continue;
    throw ConfigError("", "", "column " + shown(name) + " is given twice", where);
  }
}

}  // namespace

CsvTable readCsv(const std::string& path, const std::vector<std::string>& wanted) {
  LineReader reader(path);
  std::string line;
  if (!reader.next(line)) throw ConfigError("", "", "file is empty", path);
  CsvTable table;
  split(line, reader.where(), table.header);
  checkHeader(table.header, line, reader.where());

  constexpr std::size_t kAbsent = std::numeric_limits<std::size_t>::max();
  std::vector<std::size_t> place;  // of each wanted column among the cells
  for (const std::string& name : wanted) {
    const auto found = std::find(table.header.begin(), table.header.end(), name);
    place.push_back(found == table.header.end() ? kAbsent : static_cast<std::size_t>(found - table.header.begin()));
    table.columns.emplace_back();
    if (place.back() != kAbsent) table.columns.back().emplace();
  }

  std::vector<std::string> cells;
  std::optional<ConfigError> wrong_length;  // of the row before: allowed at the end of the file only
  while (reader.next(line)) {
    if (wrong_length) throw ConfigError(*wrong_length);
    split(line, reader.where(), cells);
    if (cells.size() != table.header.size()) {
      wrong_length.emplace("", "",
                           std::to_string(cells.size()) + " cells, where the header has " +
                               std::to_string(table.header.size()) +
                               (cells.size() > table.header.size() ? "; decimals must be written with a point" : ""),
                           reader.where());
      if (cells.size() > table.header.size()) throw ConfigError(*wrong_length);
      continue;
    }
    for (std::size_t i = 0; i < wanted.size(); ++i) {
      if (place[i] == kAbsent) continue;
      bool bad = false;
      table.columns[i]->push_back(numberIn(cells[place[i]], bad));
      if (!bad) continue;
      if (table.bad_cells++ == 0) table.first_bad_cell = {table.line.size(), wanted[i], shown(cells[place[i]])};
    }
    table.line.push_back(reader.number());
  }
  table.last_row_cut_off = wrong_length.has_value();
  if (table.line.empty()) throw ConfigError("", "", "has a header, but no rows", path);
  return table;
}

bool csvHasColumn(const std::string& path, const std::vector<std::string>& names) {
  try {
    LineReader reader(path);
    std::string line;
    if (!reader.next(line)) return false;
    std::replace_if(
        line.begin(), line.end(), [](char c) { return c == ';' || c == '\t'; }, ',');
    std::vector<std::string> header;
    split(line, reader.where(), header);
    return std::find_first_of(header.begin(), header.end(), names.begin(), names.end()) != header.end();
  } catch (const ConfigError&) {
    return false;
  }
}

}  // namespace brash_ice_rig
