#include <CLI/CLI.hpp>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "command.h"

namespace tileflight::app {
namespace {

/// Kind of text that may follow an option or stand for a positional argument.
enum class Value { kNone, kWord, kNumber, kFile };

struct Completed {
  std::string name;  ///< "--layout"; a positional's own name
  std::string help;
  Value value = Value::kFile;
  std::vector<std::string> words;  ///< of kWord
  bool is_positional = false;
  bool is_repeated = false;
};

/// A command, or a part of one ("scene stadium").
struct Command {
  std::string name;
  std::string help;
  std::vector<Completed> options;
  std::vector<Command> parts;
};

/// Returns the words in "TEXT:{tum-mono,euroc}"; none for other types.
std::vector<std::string> words_of(const std::string& type) {
  const std::size_t open = type.find('{'), close = type.find('}');
  std::vector<std::string> words;
  if (open == std::string::npos || close == std::string::npos) return words;
  std::istringstream list(type.substr(open + 1, close - open - 1));
  for (std::string word; std::getline(list, word, ',');) words.push_back(word);
  return words;
}

Value value_of(const CLI::Option& option, const std::vector<std::string>& words) {
  if (option.get_items_expected_max() == 0) return Value::kNone;
  if (!words.empty()) return Value::kWord;
  const std::string type = option.get_type_name();
  const bool is_number = type.starts_with("FLOAT") || type.starts_with("INT") || type.starts_with("UINT");
  return is_number ? Value::kNumber : Value::kFile;
}

Completed describe(const CLI::Option& option) {
  const std::vector<std::string> words = words_of(option.get_type_name());
  return {.name = option.get_positional() ? option.get_name(true) : "--" + option.get_lnames().front(),
          .help = option.get_description(),
          .value = value_of(option, words),
          .words = words,
          .is_positional = option.get_positional(),
          .is_repeated = option.get_items_expected_max() > 1};
}

Command describe(const CLI::App& app) {
  Command command{.name = app.get_name(), .help = app.get_description()};
  for (const CLI::Option* option : app.get_options()) {
    if (option->get_positional() || !option->get_lnames().empty()) command.options.push_back(describe(*option));
  }
  for (const CLI::App* part : app.get_subcommands([](const CLI::App*) { return true; }))
    command.parts.push_back(describe(*part));
  return command;
}

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : " ") + word;
  return text;
}

std::string names_of(const std::vector<Command>& commands) {
  std::vector<std::string> names;
  for (const Command& command : commands) names.push_back(command.name);
  return joined(names);
}

std::string options_of(const Command& command) {
  std::vector<std::string> names;
  for (const Completed& option : command.options) {
    if (!option.is_positional) names.push_back(option.name);
  }
  return joined(names);
}

void write_bash_values(std::ostream& out, const std::string& where, const Command& command) {
  for (const Completed& option : command.options) {
    const std::string pattern = "    '" + where + " " + option.name + "')";
    if (option.is_positional) continue;
    if (option.value == Value::kWord) out << pattern << " words='" << joined(option.words) << "' ;;\n";
    if (option.value == Value::kNumber) out << pattern << " return ;;\n";
  }
}

void write_bash_command(std::ostream& out, const std::string& where, const Command& command) {
  out << "    '" << where << "') options='" << options_of(command) << "'";
  if (!command.parts.empty()) out << " parts='" << names_of(command.parts) << "'";
  for (const Completed& option : command.options) {
    if (option.is_positional && option.value == Value::kWord)
      out << "; [[ $words || $current == -* ]] || words='" << joined(option.words) << "'";
  }
  out << " ;;\n";
}

/// Calls `write(where, command)` for the application, its commands and their parts; `where`: "tileflight scene
/// stadium".
template <typename Write>
void for_each_command(const Command& command, const std::string& where, const Write& write) {
  write(where, command);
  for (const Command& part : command.parts) for_each_command(part, where + " " + part.name, write);
}

/// Quotes text for single quotes of a shell, and for the brackets or the place after the colon of a specification of
/// _arguments.
std::string zsh_text(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '\'') {
      out += "'\\''";
    } else {
      if (c == '[' || c == ']' || c == ':' || c == '\\') out += '\\';
      out += c;
    }
  }
  return out;
}

std::string zsh_action(const Completed& option) {
  switch (option.value) {
    case Value::kWord:
      return ":(" + joined(option.words) + ")";
    case Value::kNumber:
      return ": ";
    default:
      return ":_files";
  }
}

std::string zsh_specification(const Completed& option) {
  if (option.is_positional) return (option.is_repeated ? "*:" : ":") + zsh_text(option.name) + zsh_action(option);
  const std::string name = (option.is_repeated ? "*" : "") + option.name;
  const std::string help = "[" + zsh_text(option.help) + "]";
  if (option.value == Value::kNone) return name + help;
  return name + "=" + help + ":value" + zsh_action(option);
}

/// zsh function of a command: its options, or the names of its parts and then the part's function.
void write_zsh_function(std::ostream& out, const std::string& where, const Command& command) {
  std::string function = "_" + where;
  for (char& c : function) c = c == ' ' ? '_' : c;
  out << function << "() {\n";
  if (!command.parts.empty()) out << "  local state line context\n  typeset -A opt_args\n";
  out << "  _arguments -S";
  for (const Completed& option : command.options) out << " \\\n    '" << zsh_specification(option) << "'";
  if (command.parts.empty()) {
    out << "\n}\n\n";
    return;
  }
  out << " \\\n    ':command:->command' '*::argument:->argument'\n  case $state in\n    command)\n      local -a "
         "commands=(\n";
  for (const Command& part : command.parts) out << "        '" << part.name << ":" << zsh_text(part.help) << "'\n";
  out << "      )\n      _describe command commands ;;\n    argument) (( $+functions[" << function
      << "_$line[1]] )) && " << function << "_$line[1] ;;\n  esac\n}\n\n";
}

/// Writes the completion script for bash (a function registered with `complete -F`, as the Bash manual's section
/// Programmable Completion describes it), made from the application's own commands: their names, options, the words
/// that an option may have, files where a value may be one, nothing where it is a number.
std::string bash_completion(const CLI::App& app) {
  const Command root = describe(app);
  std::ostringstream out;
  out << R"(# bash completion of tileflight; made by `tileflight completion bash`
_tileflight() {
  local current=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD-1]} where=tileflight options= parts= words= i
  COMPREPLY=()
  for ((i = 1; i < COMP_CWORD; i++)); do
    case "$where ${COMP_WORDS[i]}" in
)";
  for_each_command(root, root.name, [&](const std::string& where, const Command& command) {
    if (where != command.name) out << "      '" << where << "') where='" << where << "' ;;\n";
  });
  out << R"(    esac
  done
  # --option=value is three words here.
  if [[ $current == = ]]; then current=
  elif [[ $previous == = ]]; then previous=${COMP_WORDS[COMP_CWORD-2]}; fi
  case "$where $previous" in
)";
  for_each_command(root, root.name,
                   [&](const std::string& where, const Command& command) { write_bash_values(out, where, command); });
  out << "  esac\n  case $where in\n";
  for_each_command(root, root.name,
                   [&](const std::string& where, const Command& command) { write_bash_command(out, where, command); });
  out << R"(  esac
  if [[ $words ]]; then mapfile -t COMPREPLY < <(compgen -W "$words" -- "$current")
  elif [[ $current == -* ]]; then mapfile -t COMPREPLY < <(compgen -W "$options" -- "$current")
  elif [[ $parts ]]; then mapfile -t COMPREPLY < <(compgen -W "$parts" -- "$current")
  else compopt -o filenames 2>/dev/null; mapfile -t COMPREPLY < <(compgen -f -- "$current"); fi
}
complete -F _tileflight tileflight
)";
  return out.str();
}

/// Writes the completion script for zsh: a function of _arguments and _describe with each option's help (zsh manual,
/// section Completion System). Its place is a folder of $fpath, as _tileflight.
std::string zsh_completion(const CLI::App& app) {
  const Command root = describe(app);
  std::ostringstream out;
  out << "#compdef tileflight\n# zsh completion of tileflight; made by `tileflight completion zsh`\n\n";
  for_each_command(root, root.name,
                   [&](const std::string& where, const Command& command) { write_zsh_function(out, where, command); });
  out << "if [ \"$funcstack[1]\" = _tileflight ]; then _tileflight \"$@\"; else compdef _tileflight tileflight; fi\n";
  return out.str();
}

}  // namespace

void add_completion(CLI::App& app, CommonOptions&, Selection& selection) {
  auto shell = std::make_shared<std::string>();
  CLI::App* command = app.add_subcommand("completion", "script by which a shell completes commands, options and files");
  command->footer(
      "Example:\n  source <(tileflight completion bash)                     # in ~/.bashrc\n"
      "  tileflight completion zsh > ~/.zfunc/_tileflight          # in a folder of zsh's $fpath");
  command->add_option("shell", *shell, "shell to write the script for")
      ->required()
      ->check(CLI::IsMember({"bash", "zsh"}))
      ->option_text("SHELL:{bash,zsh} REQUIRED");
  command->callback([shell, &app, &selection] {
    selection.run = [shell, &app](const CommonOptions&, const Progress&) -> Output {
      return {{}, *shell == "bash" ? bash_completion(app) : zsh_completion(app)};
    };
  });
}

}  // namespace tileflight::app
