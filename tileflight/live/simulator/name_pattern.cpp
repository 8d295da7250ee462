#include "tileflight/live/simulator/name_pattern.h"

#include <re2/re2.h>

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

}  // namespace tileflight::simulator
