#include "tileflight/core/drawing/html.h"

#include "tileflight/core/base/raw_bytes.h"

namespace tileflight::drawing {
namespace {

constexpr std::string_view kReplacement = "\xEF\xBF\xBD";  // U+FFFD

/// Length of the well-formed UTF-8 sequence at the start (RFC 3629: no overlong forms, no surrogates); 0 if there is
/// none.
std::size_t sequence_length(std::string_view s) {
  const auto byte = [&](std::size_t i) { return i < s.size() ? static_cast<unsigned char>(s[i]) : 0u; };
  const auto continues = [&](std::size_t i, unsigned low = 0x80, unsigned high = 0xBF) {
    return byte(i) >= low && byte(i) <= high;
  };
  const unsigned first = byte(0);
  if (first < 0x80) return 1;
  if (first >= 0xC2 && first <= 0xDF) return continues(1) ? 2 : 0;
  if (first >= 0xE0 && first <= 0xEF) {
    return continues(1, first == 0xE0 ? 0xA0 : 0x80, first == 0xED ? 0x9F : 0xBF) && continues(2) ? 3 : 0;
  }
  if (first >= 0xF0 && first <= 0xF4) {
    return continues(1, first == 0xF0 ? 0x90 : 0x80, first == 0xF4 ? 0x8F : 0xBF) && continues(2) && continues(3) ? 4
                                                                                                                  : 0;
  }
  return 0;
}

/// XML 1.0, production Char: no control characters except tab and line ends, not U+FFFE and U+FFFF.
bool is_allowed(std::string_view sequence) {
  if (sequence.size() == 1) {
    const auto c = static_cast<unsigned char>(sequence[0]);
    return (c >= 0x20 && c != 0x7F) || c == '\t' || c == '\n';
  }
  return sequence != "\xEF\xBF\xBE" && sequence != "\xEF\xBF\xBF";
}

std::string escaped(std::string_view plain) {
  std::string result;
  result.reserve(plain.size());
  while (!plain.empty()) {
    const std::size_t length = sequence_length(plain);
    const std::string_view sequence = plain.substr(0, length);
    plain.remove_prefix(length == 0 ? 1 : length);
    if (length == 0 || !is_allowed(sequence)) {
      result += kReplacement;
    } else if (sequence == "&") {
      result += "&amp;";
    } else if (sequence == "<") {
      result += "&lt;";
    } else if (sequence == ">") {
      result += "&gt;";
    } else if (sequence == "\"") {
      result += "&quot;";
    } else if (sequence == "'") {
      result += "&#39;";
    } else {
      result += sequence;
    }
  }
  return result;
}

std::string opened(std::string_view name, const Attributes& attributes) {
  std::string result = "<" + std::string(name);
  for (const auto& [key, value] : attributes) result += " " + std::string(key) + "=\"" + escaped(value) + "\"";
  return result;
}

}  // namespace

Html Html::trusted(std::string markup) {
  Html html;
  html.markup_ = std::move(markup);
  return html;
}

Html& Html::operator+=(const Html& other) {
  markup_ += other.markup_;
  return *this;
}

Html text(std::string_view plain) { return Html::trusted(escaped(plain)); }

Html text_with_code(std::string_view plain) {
  Html result;
  while (true) {
    const std::size_t opening = plain.find('`');
    const std::size_t closing = opening == plain.npos ? plain.npos : plain.find('`', opening + 1);
    if (closing == plain.npos) return result + text(plain);
    result += text(plain.substr(0, opening)) + element("code", text(plain.substr(opening + 1, closing - opening - 1)));
    plain.remove_prefix(closing + 1);
  }
}

Html element(std::string_view name, const Attributes& attributes, const Html& content) {
  return Html::trusted(opened(name, attributes) + ">" + content.str() + "</" + std::string(name) + ">");
}

Html element(std::string_view name, const Html& content) { return element(name, {}, content); }

Html empty_element(std::string_view name, const Attributes& attributes) {
  return Html::trusted(opened(name, attributes) + "/>");
}

std::string data_uri(std::string_view media_type, std::string_view bytes) {
  return "data:" + std::string(media_type) + ";base64," + base::base64(bytes);
}

}  // namespace tileflight::drawing
