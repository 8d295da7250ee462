#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace tileflight::flight_logs {

/// Reads a text table row by row: RFC 4180 (quoted cells may hold separators, line ends and doubled quotes), with a
/// configurable separator, any line end, and blanks ignored around unquoted cells.
class CsvReader {
 public:
  /// `text` must outlive this.
  CsvReader(std::string_view text, char separator) : rest_(text), separator_(separator) {}

  /// Reads the next row that is not blank into `cells`; false at the end.
  bool next(std::vector<std::string>& cells);

 private:
  std::string quoted_cell();
  std::string plain_cell();
  void read_row(std::vector<std::string>& cells);

  std::string_view rest_;
  char separator_;
};

/// The most frequent of comma, semicolon and tab in a table's first line, outside quotes.
char detect_separator(std::string_view header);

}  // namespace tileflight::flight_logs
