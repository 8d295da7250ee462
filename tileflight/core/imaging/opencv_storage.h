#pragma once

#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

namespace tileflight::imaging {

/// A value of an OpenCV FileStorage: a number, a word, a list or a matrix, as unparsed text.
struct StorageEntry {
  std::string key;                  ///< as written in the file
  std::vector<std::string> values;  ///< a matrix row by row
  std::string rows, cols;           ///< of a matrix; empty if the file does not state them
};

/// The top-level values of an OpenCV FileStorage (https://docs.opencv.org/4.x/da/d56/group__core__xml.html).
class OpenCvStorage {
 public:
  /// Parses YAML or XML (which begins with "<"). `file` is used in messages. Throws InputError(file, line and cause).
  OpenCvStorage(std::string_view text, const std::string& file);

  /// The first of these keys that exists; nullptr if none does. Keys are given in lower case without "_": image_Width,
  /// imageWidth and image_width are equivalent. Throws InputError if a key occurs twice.
  const StorageEntry* find(std::initializer_list<std::string_view> keys) const;

 private:
  std::string file_;
  std::vector<StorageEntry> entries_;
};

}  // namespace tileflight::imaging
