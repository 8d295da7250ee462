#include "tileflight/core/imaging/opencv_storage.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cctype>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"

namespace tileflight::imaging {

namespace {

constexpr std::string_view kBlanks = " \t\r\n";

std::string plain_key(std::string_view key) {
  std::string plain;
  for (const char c : key)
    if (c != '_') plain += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return plain;
}

// YAML

/// Appends the scalars of a list; nested lists are flattened row by row.
void append_words(const YAML::Node& node, std::vector<std::string>& words, int depth = 0) {
  constexpr int kDeepest = 2;
  if (node.IsScalar()) words.push_back(node.Scalar());
  if (!node.IsSequence() || depth > kDeepest) return;
  for (const YAML::Node& item : node) append_words(item, words, depth + 1);
}

std::string scalar_of(const YAML::Node& node) { return node && node.IsScalar() ? node.Scalar() : std::string(); }

StorageEntry entry_of(const std::string& key, const YAML::Node& value) {
  StorageEntry entry{key, {}, {}, {}};
  if (!value.IsMap()) {
    append_words(value, entry.values);
    return entry;
  }
  entry.rows = scalar_of(value["rows"]);
  entry.cols = scalar_of(value["cols"]);
  if (const YAML::Node data = value["data"]) append_words(data, entry.values);
  return entry;
}

std::vector<StorageEntry> yaml_entries(std::string text, const std::string& file) {
  if (text.starts_with('%')) text[0] = '#';  // "%YAML:1.0" is not a valid YAML directive
  try {
    const YAML::Node root = YAML::Load(text);
    std::vector<StorageEntry> entries;
    if (!root.IsMap()) return entries;
    for (const auto& item : root)
      if (item.first.IsScalar()) entries.push_back(entry_of(item.first.Scalar(), item.second));
    return entries;
  } catch (const YAML::Exception& error) {
    throw InputError(file, "line " + std::to_string(error.mark.line + 1) + ": not valid YAML: " + error.msg);
  }
}

// XML: elements with text; attributes (type_id) are not needed.

class XmlEntries {
 public:
  XmlEntries(std::string_view text, const std::string& file) : text_(text), file_(file) {}

  std::vector<StorageEntry> read() {
    while (at_ < text_.size()) {
      const std::size_t tag = std::min(text_.find('<', at_), text_.size());
      add_text(text_.substr(at_, tag - at_));
      at_ = tag;
      if (at_ < text_.size()) read_markup();
    }
    if (!open_.empty()) fail("<" + open_.back() + "> is not closed");
    return std::move(entries_);
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    const auto line = 1 + std::count(text_.begin(), text_.begin() + static_cast<std::ptrdiff_t>(at_), '\n');
    throw InputError(file_, "line " + std::to_string(line) + ": not valid XML: " + what);
  }

  /// The text up to `end`; continues after it.
  std::string_view take_until(std::string_view end) {
    const std::size_t stop = text_.find(end, at_);
    if (stop == std::string_view::npos) fail("the file ends within a tag or comment");
    const std::string_view inside = text_.substr(at_, stop - at_);
    at_ = stop + end.size();
    return inside;
  }

  void read_markup() {
    const std::string_view rest = text_.substr(at_);
    if (rest.starts_with("<!--")) return void(take_until("-->"));
    if (rest.starts_with("<?")) return void(take_until("?>"));
    if (rest.starts_with("<!")) return void(take_until(">"));
    if (rest.starts_with("</")) return close();
    open();
  }

  void open() {
    std::string_view tag = take_until(">").substr(1);
    const bool empty = tag.ends_with('/');
    if (empty) tag.remove_suffix(1);
    const std::string name(base::take_field(tag, kBlanks));
    if (open_.empty() && name != "opencv_storage")
      throw InputError(file_, "is XML with the root element <" + name + ">, not OpenCV's <opencv_storage>");
    if (open_.size() == 1) entries_.push_back({name, {}, {}, {}});
    if (!empty) open_.push_back(name);
  }

  void close() {
    std::string_view tag = take_until(">").substr(2);
    const std::string_view name = base::take_field(tag, kBlanks);
    if (open_.empty() || open_.back() != name) fail("</" + std::string(name) + "> has no opening tag");
    open_.pop_back();
  }

  void add_text(std::string_view text) {
    const std::size_t depth = open_.size();
    if (depth != 2 && depth != 3) return;
    const bool is_value = depth == 2 || open_.back() == "data" || open_.back() == "_";
    while (true) {
      std::string_view word = base::take_field(text, kBlanks);
      if (word.empty()) return;
      if (word.size() > 1 && word.starts_with('"') && word.ends_with('"')) word = word.substr(1, word.size() - 2);
      StorageEntry& entry = entries_.back();
      if (is_value) entry.values.emplace_back(word);
      if (depth == 3 && open_.back() == "rows") entry.rows = word;
      if (depth == 3 && open_.back() == "cols") entry.cols = word;
    }
  }

  std::string_view text_;
  std::string file_;
  std::size_t at_ = 0;
  std::vector<std::string> open_;
  std::vector<StorageEntry> entries_;
};

}  // namespace

OpenCvStorage::OpenCvStorage(std::string_view text, const std::string& file) : file_(file) {
  const std::size_t first = text.find_first_not_of("\xEF\xBB\xBF \t\r\n");
  const bool xml = first != std::string_view::npos && text[first] == '<';
  entries_ = xml ? XmlEntries(text.substr(first), file).read() : yaml_entries(std::string(text), file);
}

const StorageEntry* OpenCvStorage::find(std::initializer_list<std::string_view> keys) const {
  for (const std::string_view key : keys) {
    const auto is_it = [&](const StorageEntry& entry) { return plain_key(entry.key) == key; };
    const auto found = std::find_if(entries_.begin(), entries_.end(), is_it);
    if (found == entries_.end()) continue;
    if (std::any_of(found + 1, entries_.end(), is_it))
      throw InputError(file_, "\"" + found->key + "\" occurs twice: keep one");
    return &*found;
  }
  return nullptr;
}

}  // namespace tileflight::imaging
