#include "usage_fault.h"

#include <algorithm>
#include <cctype>
#include <limits>
#include <regex>
#include <sstream>

#include "number_text.h"
#include "tileflight/core/base/document_value.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/text_parsing.h"

namespace tileflight::app {
namespace {

std::vector<const CLI::App*> subcommands_of(const CLI::App& app) {
  return app.get_subcommands([](const CLI::App*) { return true; });
}

std::vector<std::string> commands_of(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* command : subcommands_of(app)) names.push_back(command->get_name());
  return names;
}

std::vector<std::string> options_of(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options()) {
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  }
  return names;
}

double number(const std::string& text) {
  return base::parse_number<double>(text).value_or(std::numeric_limits<double>::infinity());
}

bool is_option(const std::string& argument) {
  return argument.size() > 1 && argument[0] == '-' &&
         (argument[1] == '-' || std::isalpha(static_cast<unsigned char>(argument[1])) != 0);
}

/// Returns the command with those above it: "tileflight extract".
std::string full_name(const CLI::App& command) {
  const CLI::App* parent = command.get_parent();
  return (parent == nullptr ? "" : full_name(*parent) + " ") + command.get_name();
}

std::string look_up(const CLI::App& command) { return "; see `" + full_name(command) + " --help`"; }

std::string unknown_command(const CLI::App& app, const std::string& word) {
  const std::vector<std::string> commands = commands_of(app);
  const std::string meant = base::did_you_mean(word, commands);
  return "unknown command '" + word + "'" + (meant.empty() ? "; the commands are " + base::joined(commands) : meant);
}

std::string unknown_option(const CLI::App& command, const std::string& name) {
  const std::vector<const CLI::App*> below = subcommands_of(command);
  if (std::any_of(below.begin(), below.end(),
                  [&](const CLI::App* one) { return one->get_option_no_throw(name) != nullptr; }))
    return "options come after the command: `" + full_name(command) + " COMMAND … " + name + "`";
  const std::string meant = base::did_you_mean(name, options_of(command));
  return "`" + full_name(command) + "` has no option " + name +
         (meant.empty() ? "; `" + full_name(command) + " --help` lists them" : meant);
}

/// Rephrases "--voxel: Value 0 not in range 0.000000 to 1797…", or "[2.2e-308 - 1.8e+308]" as CLI11 from 2.4 on writes
/// it, for people; other messages are unchanged.
std::string range_fault(const std::string& fault) {
  static const std::regex kRange("(.*): Value (\\S+) not in range \\[?([^ \\]]+) (?:to|-) ([^ \\]]+)\\]?");
  std::smatch parts;
  if (!std::regex_match(fault, parts, kRange)) return fault;
  constexpr double kNoBound = 1e15;
  const double value = number(parts[2]), least = number(parts[3]), most = number(parts[4]);
  const std::string must = most < kNoBound ? "be " + rounded(least) + " to " + rounded(most)
                           : value < 0.0   ? "not be negative"
                                           : "be more than 0";
  return parts[1].str() + " must " + must + ", got " + parts[2].str();
}

/// Rephrases "--size: At least 3 required but received 2".
std::string count_fault(const std::string& fault) {
  static const std::regex kCount("(.*): At (least|most) (\\d+) required but received (\\d+)");
  std::smatch parts;
  if (!std::regex_match(fault, parts, kCount)) return fault;
  return parts[1].str() + " takes at " + parts[2].str() + " " + parts[3].str() + " comma-separated values, got " +
         parts[4].str();
}

/// Rephrases "--layout: eurok not in {tum-mono,euroc}", and adds the most similar word.
std::string choice_fault(const std::string& fault) {
  static const std::regex kChoice("(.*): (\\S+) not in \\{(.*)\\}");
  std::smatch parts;
  if (!std::regex_match(fault, parts, kChoice)) return fault;
  std::vector<std::string> words;
  std::istringstream all(parts[3].str());
  for (std::string word; std::getline(all, word, ',');) words.push_back(word);
  return parts[1].str() + " must be one of " + base::joined(words) + ", got '" + parts[2].str() + "'" +
         base::did_you_mean(parts[2].str(), words);
}

}  // namespace

std::string usage_fault(const CLI::App& app, const std::vector<std::string>& arguments, const std::string& fault) {
  const CLI::App* command = &app;
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    const std::string& argument = arguments[i];
    if (argument == "--") break;
    if (is_option(argument)) {
      const std::string name = argument.substr(0, argument.find('='));
      const CLI::Option* option = command->get_option_no_throw(name);
      if (option == nullptr) return unknown_option(*command, name);
      if (name == argument && option->get_items_expected_min() > 0) ++i;  // skip its value
    } else if (const auto commands = subcommands_of(*command); !commands.empty()) {
      const auto chosen = std::find_if(commands.begin(), commands.end(),
                                       [&](const CLI::App* known) { return known->get_name() == argument; });
      if (chosen == commands.end()) return unknown_command(*command, argument);
      command = *chosen;
    }
  }
  if (!commands_of(*command).empty())
    return "a command is required: " + base::joined(commands_of(*command)) + look_up(*command);
  const std::string told = choice_fault(count_fault(range_fault(fault)));
  return full_name(*command).substr(app.get_name().size() + 1) + ": " + told +
         (told.ends_with('?') ? "" : look_up(*command));
}

}  // namespace tileflight::app
