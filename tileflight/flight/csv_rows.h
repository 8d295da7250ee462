#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace tileflight::flight {

/// Reads a table of text row by row: RFC 4180 (cells in double quotes may hold separators, line ends and doubled
/// quotes) with a separator of its own, either line end, and blanks around cells that are not quoted.
class CsvRows {
 public:
  /// `text` must outlive this.
  CsvRows(std::string_view text, char separator) : rest_(text), separator_(separator) {}

  /// The next row that is not blank into `cells`; false at the end.
  bool next(std::vector<std::string>& cells);

 private:
  std::string quoted_cell();
  std::string plain_cell();
  void read_row(std::vector<std::string>& cells);

  std::string_view rest_;
  char separator_;
};

/// The most frequent of comma, semicolon and tab in a table's first line, outside quotes.
char separator_of(std::string_view header);

}  // namespace tileflight::flight
