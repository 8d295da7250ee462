#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace tileflight::dataset {

/// A CSV file of numbers under a header: the other sensors' readings. Infinities are written as inf and -inf.
struct NumberTable {
  std::vector<std::string> columns;       ///< names with units: "pressure [Pa]"
  std::vector<std::vector<double>> rows;  ///< a number a column
};

/// Numbers come back as they were. Reading throws InputError (file, line, cause): no header, a row of another length,
/// what is not a number.
NumberTable read_number_table(const std::filesystem::path& file);
void write_number_table(const std::filesystem::path& file, const NumberTable& table);

}  // namespace tileflight::dataset
