// SPDX-License-Identifier: Apache-2.0
// Einsum of any number of operands, by letters ("bij,bjk->bik") and an ellipsis for dimensions in front. Sums run in
// ascending order of the letters as they first stand in the equation.
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <ranges>
#include <string>
#include <utility>

#include "policy_host/onnx_engine/operators.hpp"
#include "policy_host/onnx_engine/rearrange.hpp"
#include "policy_host/onnx_engine/strides.hpp"

namespace takt::onnx_engine {

namespace {

using Labels = std::string;

constexpr char kFirstHidden = '0';  // the dimensions of an ellipsis, the last one first

struct Equation {
  std::vector<Labels> operands;
  Labels result;
};

// "..." becomes as many hidden labels as `hidden`.
Labels with_hidden(const Node& node, std::string_view term, std::size_t hidden) {
  Labels labels;
  for (std::size_t i = 0; i < term.size(); ++i) {
    if (term.substr(i).starts_with("...")) {
      for (std::size_t d = hidden; d-- > 0;) labels += static_cast<char>(kFirstHidden + static_cast<char>(d));
      i += 2;
    } else if ((term[i] >= 'a' && term[i] <= 'z') || (term[i] >= 'A' && term[i] <= 'Z')) {
      labels += term[i];
    } else {
      node.refuse("its equation holds something else than letters, commas, an ellipsis and an arrow");
    }
  }
  return labels;
}

// Dimensions that the ellipsis of an operand of `rank` stands for.
std::size_t hidden_in(const Node& node, std::string_view term, std::size_t rank) {
  if (!term.contains("...")) return 0;
  const std::size_t letters = term.size() - 3;
  if (letters > rank) node.refuse(fmt::format("its equation gives more letters than an operand has dimensions"));
  return rank - letters;
}

// Without an arrow: what stands once, in alphabetical order, behind the ellipsis.
Labels implied_result(const std::vector<Labels>& operands) {
  std::map<char, int> count;
  for (const Labels& labels : operands)
    for (const char label : labels) ++count[label];
  Labels hidden, once;
  for (const auto& [label, times] : count) {
    if (label < 'A')
      hidden.insert(hidden.begin(), label);
    else if (times == 1)
      once += label;
  }
  return hidden + once;
}

Equation read_equation(const Node& node) {
  std::string text = node.text("equation", "");
  std::erase(text, ' ');
  const std::size_t arrow = text.find("->");
  const std::string left = text.substr(0, arrow);
  std::vector<std::string> terms;
  for (const auto term : std::views::split(left, ',')) terms.emplace_back(term.begin(), term.end());
  if (terms.size() != node.input_count()) node.refuse("its equation has another number of terms than it has inputs");
  Equation equation;
  std::size_t most_hidden = 0;
  for (std::size_t i = 0; i < terms.size(); ++i) {
    const std::size_t rank = node.float_input(i).shape.size();
    const std::size_t hidden = hidden_in(node, terms[i], rank);
    most_hidden = std::max(most_hidden, hidden);
    equation.operands.push_back(with_hidden(node, terms[i], hidden));
    if (equation.operands.back().size() != rank) node.refuse(fmt::format("term {} does not fit its operand", i));
  }
  equation.result = arrow == std::string::npos ? implied_result(equation.operands)
                                               : with_hidden(node, text.substr(arrow + 2), most_hidden);
  return equation;
}

using Sizes = std::map<char, std::int64_t>;

Sizes sizes_of(const Node& node, const Equation& equation) {
  Sizes sizes;
  for (std::size_t i = 0; i < equation.operands.size(); ++i) {
    for (std::size_t d = 0; d < equation.operands[i].size(); ++d) {
      const std::int64_t size = node.input(i).shape[d];
      std::int64_t& known = sizes.try_emplace(equation.operands[i][d], size).first->second;
      if (known == 1) known = size;
      if (size != known && size != 1)
        node.refuse(fmt::format("'{}' is {} and {} long", equation.operands[i][d], known, size));
    }
  }
  return sizes;
}

Shape shape_by(const Labels& labels, const Sizes& sizes) {
  Shape shape;
  for (const char label : labels) shape.push_back(sizes.at(label));
  return shape;
}

// How far a step along each of `labels` goes in an operand; along a label that stands twice, on its diagonal.
std::vector<std::int64_t> steps_by(const Labels& labels, const Labels& operand, const Shape& shape) {
  const std::vector<std::int64_t> own = row_major_steps(shape);
  std::vector<std::int64_t> steps;
  for (const char label : labels) {
    std::int64_t step = 0;
    for (std::size_t d = 0; d < operand.size(); ++d)
      if (operand[d] == label && shape[d] != 1) step += own[d];
    steps.push_back(step);
  }
  return steps;
}

struct Operand {
  const float* from;
  std::vector<std::uint32_t> starts;  // of each result
  std::vector<std::uint32_t> terms;   // of each term of its sum
};

}  // namespace

void build_einsum(Builder& builder, const Node& node) {
  const Equation equation = read_equation(node);
  const Sizes sizes = sizes_of(node, equation);
  for (const char label : equation.result)
    if (!sizes.contains(label) || std::ranges::count(equation.result, label) != 1)
      node.refuse("its result has a letter twice, or one that no operand has");
  Labels summed;
  for (const Labels& labels : equation.operands)
    for (const char label : labels)
      if (!equation.result.contains(label) && !summed.contains(label)) summed += label;
  const Shape shape = shape_by(equation.result, sizes), inner = shape_by(summed, sizes);
  std::vector<Operand> operands;
  std::vector<const Value*> sources;
  for (std::size_t i = 0; i < equation.operands.size(); ++i) {
    const Value& in = node.input(i);
    charge_table(builder, node, shape);
    charge_table(builder, node, inner);
    operands.push_back({in.floats, strided_offsets(shape, steps_by(equation.result, equation.operands[i], in.shape), 0),
                        strided_offsets(inner, steps_by(summed, equation.operands[i], in.shape), 0)});
    sources.push_back(&in);
  }
  builder.count_matrix_work(elements(shape), elements(inner), 1);
  Value& out = builder.define_floats(node.output(), shape);
  builder.compute(
      out, sources,
      [operands = std::move(operands), to = out.floats, count = elements(shape), terms = elements(inner)]() noexcept {
        for (std::size_t i = 0; i < count; ++i) {
          float sum = 0.0F;
          for (std::size_t k = 0; k < terms; ++k) {
            float product = 1.0F;
            for (const Operand& operand : operands) product *= operand.from[operand.starts[i] + operand.terms[k]];
            sum += product;
          }
          to[i] = sum;
        }
      });
}

}  // namespace takt::onnx_engine
