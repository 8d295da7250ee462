#include "tileflight/data/flight_logs/xml_stream.h"

#include <expat.h>

#include <algorithm>
#include <cstdint>
#include <exception>
#include <memory>

#include "tileflight/core/base/input_error.h"

namespace tileflight::flight_logs {
namespace {

constexpr int kDeepest = 64;
/// Expat counts in int and rescans an unfinished tag with each piece, so pieces are large.
constexpr std::size_t kPieceBytes = std::size_t{1} << 26;

struct State {
  const XmlEvents& events;
  XML_Parser parser = nullptr;
  std::string text;
  int depth = 0;
  bool has_type = false, too_deep = false;
  std::exception_ptr fault;  ///< exceptions must not pass through Expat's C code
};

void stop(State& state) { XML_StopParser(state.parser, XML_FALSE); }

template <typename Event>
void guarded(State& state, const Event& event) {
  if (state.fault) return;
  try {
    if (!event()) stop(state);
  } catch (...) {
    state.fault = std::current_exception();
    stop(state);
  }
}

std::string_view local_name(const char* name) {
  const std::string_view whole = name;
  return whole.substr(whole.find(':') + 1);  // npos + 1 is 0
}

void XMLCALL on_start(void* data, const char* name, const char** attributes) {
  State& state = *static_cast<State*>(data);
  guarded(state, [&] {
    state.text.clear();
    if (++state.depth > kDeepest) {
      state.too_deep = true;
      return false;
    }
    XmlEvents::Attributes named;
    for (const char** pair = attributes; *pair != nullptr; pair += 2) named.emplace(local_name(pair[0]), pair[1]);
    return state.events.start(local_name(name), named);
  });
}

void XMLCALL on_end(void* data, const char* name) {
  State& state = *static_cast<State*>(data);
  guarded(state, [&] {
    --state.depth;
    const bool go_on = state.events.end(local_name(name), state.text);
    state.text.clear();
    return go_on;
  });
}

void XMLCALL on_text(void* data, const char* text, int length) {
  State& state = *static_cast<State*>(data);
  guarded(state, [&] {
    const std::size_t room = state.events.longest_text - std::min(state.events.longest_text, state.text.size());
    state.text.append(text, std::min(room, static_cast<std::size_t>(length)));
    return true;
  });
}

void XMLCALL on_type(void* data, const char*, const char*, const char*, int) {
  State& state = *static_cast<State*>(data);
  state.has_type = true;
  stop(state);
}

bool parse(XML_Parser parser, std::string_view text) {
  while (true) {
    const std::string_view piece = text.substr(0, kPieceBytes);
    text.remove_prefix(piece.size());
    if (XML_Parse(parser, piece.data(), static_cast<int>(piece.size()), text.empty()) != XML_STATUS_OK) return false;
    if (text.empty()) return true;
  }
}

std::uint64_t line_number(XML_Parser parser) {
#if XML_MAJOR_VERSION > 2 || XML_MINOR_VERSION >= 9
  return XML_GetCurrentLineNumber64(parser);
#else
  return XML_GetCurrentLineNumber(parser);
#endif
}

}  // namespace

std::string read_xml(std::string_view text, const std::string& where, const XmlEvents& events) {
  const std::unique_ptr<std::remove_pointer_t<XML_Parser>, decltype(&XML_ParserFree)> parser(XML_ParserCreate(nullptr),
                                                                                             XML_ParserFree);
  if (!parser) throw std::bad_alloc();
  State state{.events = events, .parser = parser.get(), .text = {}, .fault = nullptr};
  XML_SetUserData(parser.get(), &state);
  XML_SetElementHandler(parser.get(), on_start, on_end);
  XML_SetCharacterDataHandler(parser.get(), on_text);
  XML_SetStartDoctypeDeclHandler(parser.get(), on_type);
  const bool whole = parse(parser.get(), text);
  const std::string line = "line " + std::to_string(line_number(parser.get()));
  if (state.fault) std::rethrow_exception(state.fault);
  if (state.has_type) {
    throw InputError(where, line + ": document types are not supported; remove the <!DOCTYPE ...> part");
  }
  if (state.too_deep) return line + ": elements are nested deeper than " + std::to_string(kDeepest);
  const XML_Error error = XML_GetErrorCode(parser.get());
  if (whole || error == XML_ERROR_ABORTED) return "";
  return line + ": " + XML_ErrorString(error);
}

}  // namespace tileflight::flight_logs
