#pragma once

#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

namespace tileflight::imaging {

/// A value of an OpenCV FileStorage: a number, a word, a list or a matrix, as the words that the file has.
struct StorageEntry {
  std::string key;                 ///< as it is written
  std::vector<std::string> words;  ///< of a matrix row by row
  std::string rows, cols;          ///< of a matrix; empty where the file does not say
};

/// The values at the top of an OpenCV FileStorage (https://docs.opencv.org/4.x/da/d56/group__core__xml.html).
class OpenCvStorage {
 public:
  /// From YAML or XML (which begins with "<"). `file` is for messages. Throws InputError(file, line and cause).
  OpenCvStorage(std::string_view text, const std::string& file);

  /// The first of these keys that is there; a null pointer if none is. Keys are given in lower case without "_":
  /// image_Width, imageWidth and image_width are one. Throws InputError when a key is there twice.
  const StorageEntry* find(std::initializer_list<std::string_view> keys) const;

 private:
  std::string file_;
  std::vector<StorageEntry> entries_;
};

}  // namespace tileflight::imaging
