// The rules of the picking page's JavaScript. Run from the repository's top, as `check` beside this file does.

import js from "@eslint/js";
import globals from "globals";
import tseslint from "typescript-eslint";

export default tseslint.config(
  { ignores: ["**/*.d.ts"] },
  js.configs.recommended,
  ...tseslint.configs.strictTypeChecked,
  {
    linterOptions: { noInlineConfig: true, reportUnusedDisableDirectives: "error" },
    languageOptions: {
      globals: globals.browser,
      parserOptions: { project: "./tsconfig.json", tsconfigRootDir: import.meta.dirname },
    },
    rules: {
      // No way around the types.
      "no-warning-comments": ["error", { terms: ["@ts-ignore", "@ts-nocheck", "@ts-expect-error", "eslint-disable", "{any", "{*}", "<any", "any>", "any[]"], location: "anywhere" }],
      // What a browser must not do here: the page shows labels that strangers may have written.
      "no-restricted-properties": ["error", ...["innerHTML", "outerHTML", "insertAdjacentHTML", "write"].map((property) => ({ property, message: "Text goes in as text: textContent, append." }))],
      "no-restricted-globals": ["error", "event", "name", "status", "length", "alert", "confirm", "prompt"],
      "no-console": "error",
      eqeqeq: "error",
      "no-var": "error",
      "prefer-const": "error",
      "no-shadow": "error",
      "no-param-reassign": "error",
      "no-implicit-coercion": "error",
      "no-else-return": "error",
      "no-useless-return": "error",
      "object-shorthand": "error",
      "prefer-template": "error",
      "prefer-arrow-callback": "error",
      complexity: ["error", 14], // it counts each ?? and ?. as a branch
      "max-depth": ["error", 4],
      "max-params": ["error", 6],
      "max-lines": ["error", 350],
      "max-lines-per-function": ["error", { max: 45, skipComments: true, skipBlankLines: true }],
      // Numbers and what may be missing stand in sentences; arrows that end in a call need no braces.
      "@typescript-eslint/restrict-template-expressions": ["error", { allowNumber: true, allowNullish: true, allowBoolean: true }],
      "@typescript-eslint/no-confusing-void-expression": ["error", { ignoreArrowShorthand: true }],
      // Types hold what the server sends to be as it says; an index into a list may still miss.
      "@typescript-eslint/no-unnecessary-condition": "off",
      "@typescript-eslint/no-extraneous-class": ["error", { allowConstructorOnly: true }],
    },
  },
);
