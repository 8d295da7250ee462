#include "tileflight/live/simulator/object_names.h"

#include <re2/re2.h>

#include <algorithm>
#include <string_view>

#include "tileflight/core/base/hash.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::simulator {
namespace {

constexpr std::size_t kMaxPatternLength = 1000;
constexpr std::int64_t kMaxMemory_bytes = 1 << 20;

re2::RE2::Options make_re2_options(NamePattern::Case letters) {
  re2::RE2::Options options;
  options.set_log_errors(false);
  options.set_case_sensitive(letters == NamePattern::Case::kHeeded);
  options.set_max_mem(kMaxMemory_bytes);
  options.set_encoding(re2::RE2::Options::EncodingLatin1);  // names are bytes: none is malformed
  options.set_dot_nl(true);
  return options;
}

}  // namespace

struct NamePattern::Impl {
  re2::RE2 expression;
};

NamePattern::NamePattern(const std::string& expression, Case letters) {
  if (expression.size() > kMaxPatternLength) throw InputError("pattern", "longer than 1000 characters");
  impl_.reset(new Impl{{expression, make_re2_options(letters)}});
  if (!impl_->expression.ok()) {
    throw InputError("pattern '" + expression.substr(0, 80) + "'",
                     "is not a supported regular expression: " + impl_->expression.error());
  }
}

NamePattern::~NamePattern() = default;

bool NamePattern::matches(const std::string& name) const { return re2::RE2::FullMatch(name, impl_->expression); }

namespace {

bool is_letter_or_digit(char c) { return (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z'); }

bool is_word_character(char c) { return is_letter_or_digit(c) || c == '_'; }

/// Returns the replacement of a separator of words, whose number of `_` tells which it was; empty: not a separator.
std::string_view joint_of(char c) {
  if (c == '-') return "_";
  if (c == '/') return "__";
  if (c == '#') return "___";
  return {};
}

/// Returns whether the name consists of words of letters and digits, with single separators between them.
bool is_words_and_joints(std::string_view name) {
  bool after_word = false;
  for (const char c : name) {
    if (!is_letter_or_digit(c) && (!after_word || joint_of(c).empty())) return false;
    after_word = is_letter_or_digit(c);
  }
  return after_word;
}

std::string join_words(std::string_view name) {
  std::string joined;
  for (const char c : name) {
    if (is_letter_or_digit(c)) {
      joined += c;
    } else {
      joined += joint_of(c);
    }
  }
  return joined;
}

/// Tells names apart that differ in foreign bytes alone.
std::string hash_digits(const std::string& name) {
  constexpr std::size_t kDigits = 8;
  base::Sha256 hash;
  hash.add(name);
  return hash.hex().substr(0, kDigits);
}

std::string without_ending(const std::string& file) {
  constexpr std::string_view kEnding = ".glb";
  return file.ends_with(kEnding) ? file.substr(0, file.size() - kEnding.size()) : file;
}

std::string file_of(const std::string& mesh_name) {
  return mesh_name.empty() ? std::string("surface") : without_ending(mesh_name);
}

}  // namespace

std::string to_word_name(const std::string& name) {
  if (is_words_and_joints(name)) return join_words(name);
  std::string result = name;
  std::ranges::replace_if(
      result, [](char c) { return !is_word_character(c); }, '_');
  return result + "_" + hash_digits(name);
}

std::string tile_name(const std::string& mesh_name) { return to_word_name(file_of(mesh_name)); }

std::string client_name(const render::SceneObject& object) {
  if (!object.name.empty())
    return std::ranges::all_of(object.name, is_word_character) ? object.name : to_word_name(object.name);
  if (object.feature == imaging::kNoFeature) return tile_name(object.tile);
  return to_word_name(file_of(object.tile) + "#" + std::to_string(object.feature));
}

}  // namespace tileflight::simulator
