#include "tools/common/command_line.h"

#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdlib>
#include <map>
#include <numeric>
#include <set>
#include <sstream>
#include <string_view>
#include <vector>

#include "formats/parallel.h"
#include "tools/common/json.h"

namespace voxkit::cli {
namespace {

/// Insertions, deletions and substitutions that make b of a.
size_t edit_distance(const std::string& a, const std::string& b) {
  std::vector<size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), size_t{0});
  for (size_t i = 0; i < a.size(); ++i) {
    size_t diagonal = row[0]++;
    for (size_t j = 0; j < b.size(); ++j) {
      const size_t substituted = diagonal + (a[i] != b[j]);
      diagonal = row[j + 1];
      row[j + 1] = std::min({substituted, row[j] + 1, diagonal + 1});
    }
  }
  return row.back();
}

struct ExitCode {
  int code;
  const char* meaning;
};
constexpr ExitCode exit_codes[] = {{0, "done"},
                                   {1, "the check answered no"},
                                   {2, "usage"},
                                   {3, "input unreadable"},
                                   {4, "output cannot be written, or exists"},
                                   {5, "a limit was reached"},
                                   {6, "the device asked for is not there"},
                                   {70, "a bug of ours"}};

/// All in a sentence, in lines of at most 98 characters.
std::string exit_codes_text() {
  std::string text = "Exit codes:";
  for (const auto& [code, meaning] : exit_codes)
    text += fmt::format("{} {} {}", code == 0 ? "" : ";", code, meaning);
  text += '.';
  for (size_t line = 0; line + 98 < text.size();) {
    const size_t end = text.rfind(' ', line + 98);
    text[end] = '\n';
    line = end + 1;
  }
  return text;
}

std::string nearest_option(const CLI::App& app, const std::string& name) {
  std::string nearest;
  size_t least = std::string::npos;
  for (const CLI::Option* option : app.get_options()) {
    std::vector<std::string> names;
    for (const std::string& n : option->get_lnames()) names.push_back("--" + n);
    for (const std::string& n : option->get_snames()) names.push_back("-" + n);
    for (const std::string& n : names) {
      const size_t distance = edit_distance(name, n);
      if (distance < least) {
        least = distance;
        nearest = n;
      }
    }
  }
  return nearest;
}

}  // namespace

struct CommandLine::State {
  State(const std::string& tool, const std::string& purpose, const std::string& example_lines)
      : app(purpose, tool), examples(example_lines) {}
  CLI::App app;
  CommonOptions options;
  std::string examples;
  std::map<std::string, std::vector<std::string>> words;  ///< that options may have as values, by their names
  std::set<std::string> files;                            ///< options whose values name files
  struct Behind {
    CLI::Option* option;
    std::function<Status(size_t, const std::string&)> store;
  };
  std::vector<Behind> behind;  ///< options of the argument before
};

CommandLine::CommandLine(const std::string& tool, const std::string& purpose, const std::string& examples)
    : state_(std::make_unique<State>(tool, purpose, examples)) {
  CLI::App& app = state_->app;
  app.set_help_flag("-h,--help", "Show this help");
  app.set_version_flag("-V,--version", tool + " " + version_text(), "Show the version");
  app.get_formatter()->column_width(34);
  app.footer("Examples:\n" + examples + "\n" + exit_codes_text());
}

CommandLine::~CommandLine() = default;

void CommandLine::option(const std::string& names, const std::string& metavar, const std::string& help,
                         Parser parser, bool required) {
  const std::string shown = names.substr(names.rfind(',') == names.npos ? 0 : names.rfind(',') + 1);
  state_->app
      .add_option_function<std::string>(
          names,
          [read = std::move(parser.read), shown](const std::string& value) {
            if (const Status status = read(value); !status)
              throw CLI::ValidationError(shown, status.error().what);
          },
          help)
      ->type_name(metavar)
      ->required(required);
  state_->words[shown] = std::move(parser.words);
}

void CommandLine::text(const std::string& names, const std::string& metavar, const std::string& help,
                       std::string& value, bool required) {
  const auto store = [&value](const std::string& given) -> Status {
    value = given;
    return {};
  };
  option(names, metavar, help, store, required);
}

void CommandLine::file(const std::string& names, const std::string& metavar, const std::string& help,
                       std::string& value, bool required) {
  text(names, metavar, help, value, required);
  state_->files.insert(names.substr(names.rfind(',') + 1));
}

void CommandLine::flag(const std::string& names, const std::string& help, bool& value) {
  state_->app.add_flag(names, value, help);
}

void CommandLine::argument(const std::string& metavar, const std::string& help, std::string& value,
                           bool required) {
  state_->app.add_option(metavar, value, help)->required(required)->type_name("");
}

void CommandLine::arguments(const std::string& metavar, const std::string& help,
                            std::vector<std::string>& values) {
  state_->app.add_option(metavar, values, help)->required()->type_name("");
}

void CommandLine::behind_arguments(const std::string& name, const std::string& metavar,
                                   const std::string& help,
                                   std::function<Status(size_t, const std::string&)> store) {
  CLI::Option* const option = state_->app.add_option(name)->expected(1);
  option->description(help)->type_name(metavar)->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  state_->behind.push_back({option, std::move(store)});
}

/// Finds out behind which argument each of them came.
Status CommandLine::store_behind_arguments() {
  for (const auto& [option, store] : state_->behind) {
    size_t arguments = 0, values = 0, last = 0;
    for (const CLI::Option* parsed : state_->app.parse_order()) {
      if (parsed->get_positional()) ++arguments;
      if (parsed != option) continue;
      const std::string value = option->results().at(values++);
      const std::string shown = option->get_name() + ": ";
      if (arguments == 0 || arguments == last)
        return bad_usage(
            fmt::format("{}\"{}\": expected it once, behind the input that it is of", shown, value));
      last = arguments;
      if (const Status status = store(arguments - 1, value); !status)
        return bad_usage(shown + status.error().what);
    }
  }
  return {};
}

void CommandLine::declare_common() {
  CLI::App& app = state_->app;
  CommonOptions& options = state_->options;
  // A tool may have given a short name another meaning: -q is the quality of encoders.
  const auto free_names = [&app](const std::string& short_name, const std::string& long_name) {
    return app.get_option_no_throw(short_name) == nullptr ? short_name + "," + long_name : long_name;
  };
  options.threads = 0;
  const auto quiet = app.add_flag(free_names("-q", "--quiet"), options.quiet, "Print nothing but errors");
  app.add_flag(free_names("-v", "--verbose"), options.verbose, "Print more detail on standard error")
      ->excludes(quiet);
  option(free_names("-j", "--threads"), "N",
         "Worker threads; 0: all that this process may use (also VOX_THREADS)",
         integer(options.threads, 0, 4096));
  flag(free_names("-f", "--force"), "Overwrite an existing output", options.force);
  flag("--json", "Print the result as one JSON object", options.json);
  option("--progress", "auto|plain|never", "Progress on standard error; plain: key=value lines",
         one_of({"auto", "plain", "never"}, [&options](const std::string& word) {
           options.progress = word == "auto"    ? ProgressMode::automatic
                              : word == "plain" ? ProgressMode::plain
                                                : ProgressMode::never;
         }));
  option("--max-memory", "SIZE", "Refuse to use more memory for voxels, such as 512M or 3G",
         [&options](const std::string& text) -> Status {
           VOX_TRY(options.max_memory, read_size(text));
           return {};
         });
}

std::string CommandLine::description() const {
  const CLI::App& app = state_->app;
  Json arguments = Json::array(), options = Json::array(), examples = Json::array(), codes = Json::array();
  for (const CLI::Option* option : app.get_options()) {
    Json entry = Json::object();
    if (option->get_positional()) {
      entry.set("name", option->get_name(true)).set("help", option->get_description());
      arguments.push(std::move(entry.set("several", option->get_items_expected_max() > 1)));
      continue;
    }
    Json names = Json::array(), excludes = Json::array(), words = Json::array();
    for (const std::string& name : option->get_snames()) names.push("-" + name);
    for (const std::string& name : option->get_lnames()) names.push("--" + name);
    for (const CLI::Option* other : option->get_excludes()) excludes.push(other->get_name());
    const std::string name = option->get_name();
    const bool takes_value = option->get_items_expected_max() > 0;
    if (const auto known = state_->words.find(name); known != state_->words.end())
      for (const std::string& word : known->second) words.push(word);
    entry.set("names", std::move(names)).set("value", takes_value ? option->get_type_name() : "");
    entry.set("help", option->get_description()).set("required", option->get_required());
    entry.set("kind", state_->files.contains(name) ? "file" : "").set("words", std::move(words));
    entry.set("excludes", std::move(excludes));
    options.push(std::move(entry));
  }
  std::istringstream lines(state_->examples);
  for (std::string line; std::getline(lines >> std::ws, line);) examples.push(line);
  for (const auto& [code, meaning] : exit_codes)
    codes.push(std::move(Json::object().set("code", code).set("meaning", meaning)));
  Json json = Json::result();
  json.set("tool", app.get_name()).set("purpose", app.get_description());
  json.set("arguments", std::move(arguments)).set("options", std::move(options));
  json.set("examples", std::move(examples)).set("exit_codes", std::move(codes));
  return json.text();
}

Result<CommandLine::Outcome> CommandLine::parse(int argc, char** argv) {
  CLI::App& app = state_->app;
  declare_common();
  if (argc == 2 && std::string_view(argv[1]) == "--describe") return Outcome{description(), {}};
  try {
    app.parse(argc, argv);
  } catch (const CLI::CallForHelp&) {
    return Outcome{app.help(), {}};
  } catch (const CLI::CallForVersion& version) {
    return Outcome{std::string(version.what()) + "\n", {}};
  } catch (const CLI::ParseError& error) {
    // An unknown option is the likely cause of whatever else is wrong.
    for (const std::string& extra : app.remaining()) {
      if (extra.size() < 2 || extra[0] != '-') continue;
      const std::string name = extra.substr(0, extra.find('='));
      return bad_usage(fmt::format("unknown option {}: did you mean {}?", name, nearest_option(app, name)));
    }
    if (dynamic_cast<const CLI::ExtrasError*>(&error) != nullptr)
      return bad_usage(fmt::format("unexpected argument \"{}\": see --help", app.remaining().front()));
    std::string what = error.what();
    while (!what.empty() && (what.back() == '\n' || what.back() == ' ')) what.pop_back();
    return bad_usage(what + (what.find("expected") == what.npos ? ": see --help" : ""));
  }

  VOX_CHECK(store_behind_arguments());

  CommonOptions options = state_->options;
  if (const char* threads = std::getenv("VOX_THREADS"); threads != nullptr && app.count("--threads") == 0) {
    const auto value = read_integer(threads, 0, 4096);
    if (!value) return bad_usage("the environment variable VOX_THREADS: " + value.error().what);
    options.threads = static_cast<int>(*value);
  }
  if (options.threads == 0) options.threads = available_threads();
  return Outcome{std::nullopt, options};
}

}  // namespace voxkit::cli
